import json

import numpy as np
import pytest

from bench.strangers import count_false, draw_mixtures, find_buildings, main, merge_mixture
from merger.result import MergeResult, Method, PairResult, PairStatus
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.datasets.dataset import make_dataset


def a_result(components, pairs=()):
    return MergeResult(Method.ROBUST, 0, "", "0-a", (), tuple(components), tuple(pairs))


def a_pair(target, source, status=PairStatus.RELIABLE):
    return PairResult(target, source, status, T_target_source=np.eye(3))


def test_a_component_with_maps_of_two_buildings_is_a_false_link():
    assert count_false(a_result([("0-a", "0-b"), ("1-a", "1-b")])) == (0, 0)
    assert count_false(a_result([("0-a", "0-b", "1-a"), ("1-b",)])) == (1, 0)


def test_a_reliable_motion_between_buildings_is_a_false_pair_and_a_rejected_one_is_not():
    pairs = [a_pair("0-a", "1-a"), a_pair("0-a", "1-b", PairStatus.REJECTED), a_pair("0-a", "0-b")]
    assert count_false(a_result([("0-a",)], pairs)) == (0, 1)


def test_mixtures_are_of_two_or_three_different_buildings_and_the_same_for_a_seed(tmp_path):
    buildings = {name: [tmp_path / f"{name}{k}" for k in range(3)] for name in "abcd"}
    mixtures = draw_mixtures(buildings, 50, np.random.default_rng(3))
    assert {len(mixture) for mixture in mixtures} == {2, 3}
    assert all(len({path.name[0] for path in mixture}) == len(mixture) for mixture in mixtures)
    assert mixtures == draw_mixtures(buildings, 50, np.random.default_rng(3))


def test_buildings_are_told_apart_by_log_world_and_the_seed_of_an_office(tmp_path):
    kinds = [("office", 0, None), ("office", 1, None), ("tim", 0, None), ("tim", 1, None), ("tim", 0, "x.log")]
    for k, (world, seed, path) in enumerate(kinds):
        (tmp_path / str(k)).mkdir()
        document = {"config": {"world": world, "seed": seed, "source": {"path": path}}}
        (tmp_path / str(k) / "dataset.json").write_text(json.dumps(document))
    assert [len(folders) for folders in find_buildings(tmp_path).values()] == [1, 1, 2, 1]


def test_one_building_is_not_enough(dataset, capsys):
    assert main([str(dataset.path), "--quiet"]) == 2
    assert "need datasets of two buildings, found 1" in capsys.readouterr().err


@pytest.fixture(scope="module")
def mirrored(log_folder, tmp_path_factory):
    """The small office seen in a mirror: another building, of the same style."""
    lines = []
    for line in (log_folder / "tiny.log").read_text().splitlines():
        words = line.split()
        beams, pose = words[2:182], [words[182], f"{-float(words[183]):.5f}", f"{-float(words[184]):.6f}"]
        lines.append(" ".join([*words[:2], *reversed(beams), *pose, *pose, *words[188:]]))
    folder = tmp_path_factory.mktemp("mirrored")
    (folder / "mirrored.log").write_text("\n".join(lines) + "\n")
    config = SimConfig(source=SourceConfig(SourceKind.CARMEN, str(folder / "mirrored.log")))
    return make_dataset(config, folder / "dataset")


def test_every_map_of_a_mixture_is_merged_in_one_call(dataset, mirrored):
    mixture = merge_mixture([dataset.path, mirrored], "paper", 0)
    assert mixture.num_maps == len(list(dataset.path.glob("maps/*.yaml"))) + len(list(mirrored.glob("maps/*.yaml")))
    assert mixture.num_buildings == 2
