"""Our own methods against the baseline that is kept here, and the gate against mergers that are broken on purpose."""

import json
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from bench.cell import Outcome
from bench.gate import GateConfig, check_gate, describe
from bench.gates.comparison import compare_rows
from bench.gates.rows import GateRow, make_row
from bench.gates.tolerances import ANOTHER_MACHINE, COSTS, TOLERANCES
from bench.mergers.methods import merge_config
from bench.scoring.result_reader import read_prediction
from bench.scoring.scores import score_result
from bench.scoring.yardstick import make_yardstick
from merger import trimmed_icp
from merger.files.result_json import to_json_dict
from merger.pipeline import merge_maps
from sim.datasets.dataset import Dataset, read_dataset

BASELINE = Path(__file__).parents[1] / "baselines" / "guard.json"
ROOT = Path(__file__).parents[3]
UPDATE = f"python -m bench experiment=guard out=DIR; python -m bench.gate DIR --baseline {BASELINE} --update --no-costs"
ACCURACY = [tolerance for tolerance in TOLERANCES if tolerance.score not in COSTS]


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What ``experiment=guard`` leaves behind."""
    out = tmp_path_factory.mktemp("guard")
    command = [sys.executable, "-m", "bench", "experiment=guard", f"out={out}", "quiet=true"]
    subprocess.run(command, cwd=ROOT, check=True)
    return out


@pytest.fixture(scope="module")
def building(guarded: Path) -> Dataset:
    """The dataset of ``experiment=guard``."""
    (folder,) = (guarded / "store" / "datasets").glob("*/dataset.json")
    return read_dataset(folder.parent)


@pytest.fixture(scope="module")
def unbroken(building: Dataset, tmp_path_factory: pytest.TempPathFactory) -> list[GateRow]:
    """The paper's method, as it is, with two seeds."""
    return [score(building, tmp_path_factory.mktemp("unbroken"), seed) for seed in range(2)]


def score(dataset: Dataset, folder: Path, seed: int, workers: int = 1, **options: float) -> GateRow:
    """The row of one merge by the paper's method."""
    keys = tuple((key.replace("__", "."), value) for key, value in options.items())
    result = merge_maps(list(dataset.maps), merge_config("paper", seed, workers, keys))
    (folder / "result.json").write_text(json.dumps(to_json_dict(result)))
    prediction = read_prediction(folder / "result.json", dataset.truth.names)
    scores, _, _ = score_result(make_yardstick(dataset), prediction, Outcome("ok"))
    numbers = {name: float(value) for name, value in asdict(scores).items() if isinstance(value, (bool, int, float))}
    return make_row({"dataset": "tim", "method": "paper", "seed": seed}, "ok", None, numbers)


def judge(before: list[GateRow], after: list[GateRow]) -> list[str]:
    return [finding.message for finding in compare_rows(before, after, ACCURACY).findings]


def test_our_own_methods_are_as_good_as_their_baseline(guarded):
    comparison = check_gate(GateConfig(guarded, BASELINE, ANOTHER_MACHINE, costs=False))
    assert comparison.findings == (), f"{describe(comparison)}\nif this is meant: {UPDATE}"
    assert comparison.num_pairs == len(comparison.cells) == 3
    assert comparison.new == ()


def test_twenty_reruns_of_an_unbroken_merger_stay_green(building, unbroken, tmp_path):
    for rerun in range(20):
        again = [score(building, tmp_path, rerun % 2, workers=1 + rerun // 2 % 2)]
        assert judge([unbroken[rerun % 2]], again) == []


def test_a_merger_without_motion_averaging_turns_the_gate_red(building, tmp_path):
    """The best of all trees can be as good as the average: of eight seeds some draw another."""
    unbroken = [score(building, tmp_path, seed) for seed in range(8)]
    broken = [score(building, tmp_path, seed, averaging__max_iterations=0) for seed in range(8)]
    assert any("relation_error_m got worse" in message for message in judge(unbroken, broken))


def test_a_merger_that_accepts_pairs_of_two_inliers_turns_the_gate_red(building, unbroken, tmp_path):
    broken = [score(building, tmp_path, seed, ransac__min_inliers=2) for seed in range(2)]
    assert any("edge_precision_initial got worse" in message for message in judge(unbroken, broken))


@pytest.mark.parametrize("part", [np.s_[:2, 2], np.s_[[0, 1], [1, 0]]], ids=["translation", "rotation"])
def test_a_merger_with_a_sign_flipped_in_trimmed_icp_turns_the_gate_red(
    building, unbroken, tmp_path, monkeypatch, part
):
    fit = trimmed_icp.fit_motion

    def flipped(*arguments):
        T = np.array(fit(*arguments))
        T[part] *= -1.0
        return T

    monkeypatch.setattr(trimmed_icp, "fit_motion", flipped)
    broken = [score(building, tmp_path, seed) for seed in range(2)]
    messages = judge(unbroken, broken)
    assert any("num_wrong got worse: 0 ->" in message for message in messages)
    assert any("max_error_m got worse" in message for message in messages)


def test_a_merger_that_crashes_turns_the_gate_red(unbroken):
    crashed = [replace(row, status="failed", reason="crashed with SIGSEGV", scores={}) for row in unbroken]
    assert all("crashed with SIGSEGV" in message for message in judge(unbroken, crashed))
    assert len(judge(unbroken, crashed)) == 2
