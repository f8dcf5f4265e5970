"""Collections: many datasets, whatever interrupts their making."""

import csv
import multiprocessing
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.config import SimConfig
from sim.datasets.collection import CollectionItem, make_collection
from sim.datasets.dataset import read_dataset
from sim.datasets.dataset_check import check_dataset
from sim.datasets.dataset_folder import DatasetError, file_sha256
from sim.maps.submaps import SubmapsConfig

NUM_KILLS = 20


@pytest.fixture
def items(tiny_config: SimConfig) -> list[CollectionItem]:
    config = replace(tiny_config, submaps=SubmapsConfig(count=2))
    return [CollectionItem(f"seed={k}", replace(config, seed=k), {"seed": str(k)}) for k in range(3)]


def make(items: list[CollectionItem], out: Path, workers: int = 1) -> dict[str, str]:
    return make_collection(items, out, workers=workers, progress=lambda _stage, _done, _total: None)


def checksums(out: Path) -> dict[str, str]:
    return {str(p.relative_to(out)): file_sha256(p) for p in out.rglob("*") if p.is_file()}


def rows(out: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((out / "collection.csv").read_text().splitlines()))


def test_the_table_has_a_row_for_each_dataset_with_its_parameters_overlap_and_distortion(items, tmp_path):
    assert make(items, tmp_path) == {}
    table = rows(tmp_path)
    assert [row["folder"] for row in table] == ["seed=0", "seed=1", "seed=2"]
    for row in table:
        truth = read_dataset(tmp_path / row["folder"]).truth
        assert (row["status"], row["num_maps"], row["num_robots"], row["world"]) == ("made", "2", "2", "tiny")
        assert float(row["overlap_mean"]) == pytest.approx((truth.overlap.sum() - 2) / 2, abs=1e-4)
        assert float(row["distortion_max_m"]) == pytest.approx(truth.distortion_rms_m.max(), abs=1e-4)
        assert row["sha256"] == file_sha256(tmp_path / row["folder"] / "dataset.json")


def test_one_and_two_workers_make_the_same_files(items, tmp_path):
    make(items, tmp_path / "one")
    make(items, tmp_path / "two", workers=2)
    assert checksums(tmp_path / "one") == checksums(tmp_path / "two")


def test_what_is_finished_is_not_made_again(items, tmp_path):
    make(items[:2], tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*/dataset.json")}
    make(items, tmp_path)
    assert len(before) == 2
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in before.items())
    assert len(rows(tmp_path)) == 3


def test_a_folder_made_with_another_configuration_is_refused_before_anything_is_made(items, tmp_path):
    make(items[:1], tmp_path)
    other = [replace(item, config=replace(item.config, submaps=SubmapsConfig(count=3))) for item in reversed(items)]
    with pytest.raises(DatasetError, match="another configuration"):
        make(other, tmp_path)
    assert not (tmp_path / "seed=2").exists()


def test_a_dataset_that_cannot_be_made_is_a_row_with_its_reason_and_the_others_are_made(items, tmp_path):
    bad = replace(items[1], config=replace(items[1].config, submaps=SubmapsConfig(count=1000)))
    faults = make([items[0], bad, items[2]], tmp_path)
    assert list(faults) == ["seed=1"]
    assert [row["status"] for row in rows(tmp_path)] == ["made", "failed", "made"]
    assert "submaps.count must be" in rows(tmp_path)[1]["reason"]
    assert make(items, tmp_path) == {}
    assert [row["status"] for row in rows(tmp_path)] == ["made"] * 3


def test_killed_at_any_moment_nothing_half_made_passes_for_a_dataset_and_starting_again_finishes_it(items, tmp_path):
    start_s = time.perf_counter()
    make(items, tmp_path / "whole")
    longest_s = time.perf_counter() - start_s
    rng = np.random.default_rng(0)
    out = tmp_path / "killed"
    num_killed, sound = 0, set()
    for round_ in range(NUM_KILLS):
        child = multiprocessing.get_context("fork").Process(target=make, args=(items, out / str(round_ // 5)))
        child.start()
        child.join(rng.uniform(0.0, longest_s))
        if child.is_alive() and child.pid is not None:
            os.kill(child.pid, signal.SIGKILL)
            num_killed += 1
        child.join()
        for index in set(out.rglob("dataset.json")) - sound:
            assert check_dataset(index.parent) == []
            sound.add(index)
    assert num_killed >= NUM_KILLS // 4
    for part in out.iterdir():
        assert make(items, part) == {}
        assert checksums(part) == checksums(tmp_path / "whole")
