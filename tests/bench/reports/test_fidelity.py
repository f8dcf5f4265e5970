"""Statistics of synthetic data beside those of real data."""

import dataclasses
import math

import numpy as np
import pytest

from bench.reports.fidelity import Fidelity, FidelityRun, measure_fidelity, wall_thickness
from bench.reports.fidelity_comparison import compare_fidelity
from bench.scoring.score_rows import PairScore
from merger.grid_map import LOG_ODDS_OCCUPIED, GridMap
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.datasets.dataset import Dataset, make_dataset, read_dataset
from sim.maps.submaps import SubmapsConfig

VALUES = {item.name: 1.0 for item in dataclasses.fields(Fidelity) if item.name != "num_pairs"}
PAIRS = {"right_low": 10, "right_mid": 10, "right_high": 10, "false_pass": 10}


def fidelity(num_pairs: int = 10, **values: float) -> Fidelity:
    return Fidelity(**{**VALUES, **values}, num_pairs=dict.fromkeys(PAIRS, num_pairs))


@pytest.fixture(scope="module")
def dataset(log_folder, tmp_path_factory) -> Dataset:
    source = SourceConfig(SourceKind.CARMEN, str(log_folder / "tiny.log"))
    config = SimConfig(source=source, submaps=SubmapsConfig(count=3, overlap=0.5))
    return read_dataset(make_dataset(config, tmp_path_factory.mktemp("fidelity") / "tiny"))


def test_a_statistic_is_outside_if_it_leaves_the_real_span_widened_by_a_quarter() -> None:
    real = {"a": fidelity(wall_cells=1.0), "b": fidelity(wall_cells=2.0)}
    for value, outside in ((0.76, ""), (0.74, "x"), (2.49, ""), (2.51, "x")):
        table, sentences = compare_fidelity({"x": fidelity(wall_cells=value), **real}, ["a", "b"])
        row = table.set_index("statistic").loc["wall_cells"]
        assert (row["from"], row["to"], row["outside"]) == (0.75, 2.5, outside)
        assert len(sentences) == len(outside)


def test_a_share_of_few_real_pairs_allows_what_its_interval_allows() -> None:
    some = fidelity(right_low=0.125)
    assert compare_fidelity({"x": some, "a": fidelity(10, right_low=0.0)}, ["a"])[1] == []
    assert "right_low" in compare_fidelity({"x": some, "a": fidelity(1000, right_low=0.0)}, ["a"])[1][0]


def test_what_no_real_log_knows_is_never_outside() -> None:
    real = fidelity(right_mid=math.nan, median_error_m=math.nan)
    assert compare_fidelity({"x": fidelity(right_mid=0.3, median_error_m=9.0), "a": real}, ["a"])[1] == []


def test_shares_count_the_pairs_of_all_runs(dataset: Dataset) -> None:
    def pair(overlap: float, right: bool, error_m: float) -> PairScore:
        fields = {item.name: 0 for item in dataclasses.fields(PairScore)}
        return PairScore(**{**fields, "overlap_true": overlap, "right": right, "error_m": error_m})  # type: ignore[arg-type]  # the rest does not count

    first = FidelityRun(dataset, [pair(0.1, False, math.nan), pair(0.5, True, 0.0)], 0.1)
    second = FidelityRun(dataset, [pair(0.1, True, 0.0), pair(0.15, False, 9.0)], math.nan)
    found = measure_fidelity([first, second])
    assert found.num_pairs == {"right_low": 3, "right_mid": 0, "right_high": 1, "false_pass": 2}
    assert (found.right_low, found.right_high, found.false_pass) == (pytest.approx(1 / 3), 1.0, 0.5)
    assert math.isnan(found.right_mid)
    assert found.median_error_m == 0.1
    assert found.free_area_m2 == pytest.approx(measure_fidelity([first]).free_area_m2)


def test_a_wall_is_as_thick_as_it_is_drawn() -> None:
    log_odds = np.zeros((40, 60), dtype=np.float32)
    log_odds[10:13, 5:55] = LOG_ODDS_OCCUPIED
    assert wall_thickness(GridMap("m", log_odds, 0.05)) == pytest.approx(3.0, abs=0.2)
    assert math.isnan(wall_thickness(GridMap("m", np.zeros((4, 4), dtype=np.float32), 0.05)))
