"""The tables of the report: what is marked as best, how swept values read, where methods break."""

import pandas as pd
import pytest

from bench.reports.curves import breaking_points
from bench.reports.error_curves import recall_by_overlap
from bench.reports.summary import best_cells
from bench.reports.tables import Results, format_value, write_swept


def test_the_best_of_each_dataset_is_marked_and_errors_only_among_those_who_place_most_right() -> None:
    table = pd.DataFrame(
        {
            "dataset": ["a"] * 3 + ["b"] * 2,
            "method": ["paper", "robust", "sequential", "paper", "robust"],
            "placed": [8, 8, 2, 4, 4],
            "wrong": [1, 0, 0, 0, 0],
            "worst m": [0.1, 0.2, 0.01, 0.1, 0.3],
        }
    )
    assert set(best_cells(table)) == {(0, "placed"), (1, "placed"), (1, "wrong"), (2, "wrong"), (3, "worst m")}


def test_what_most_methods_reach_is_not_marked() -> None:
    table = pd.DataFrame({"method": ["a", "b", "c", "d"], "placed": [4, 4, 4, 3], "wrong": [1, 1, 0, 0]})
    assert set(best_cells(table)) == {(2, "wrong"), (3, "wrong")}


def test_what_reads_the_same_is_equally_good() -> None:
    table = pd.DataFrame({"method": ["a", "b", "c"], "recall": [0.5, 0.90001, 0.90002]})
    assert best_cells(table) == ((1, "recall"), (2, "recall"))


def test_a_confirmed_pair_of_maps_that_share_nothing_is_counted_as_false() -> None:
    row = {"method": "paper", "status": "reliable", "right": False, "overlap_true": 0.0}
    pairs = pd.DataFrame([row, row | {"status": "no_match"}, row | {"right": True, "overlap_true": 0.4}])
    table = recall_by_overlap(Results(pd.DataFrame(), pd.DataFrame(), pairs, ())).set_index("overlap")
    assert table["pairs"].tolist() == [2, 0, 0, 0, 1, 0]
    assert table["false"].tolist() == [1, 0, 0, 0, 0, 0]
    assert table["recall"].isna().tolist() == [True, True, True, True, False, True]


def test_who_places_nothing_is_not_best_at_making_no_mistakes() -> None:
    table = pd.DataFrame({"method": ["a", "b", "c"], "placed": [0, 4, 4], "wrong": [0, 1, 2]})
    assert (0, "wrong") not in best_cells(table)
    assert (1, "wrong") in best_cells(table)


def test_one_method_has_no_rival_to_be_better_than() -> None:
    assert best_cells(pd.DataFrame({"method": ["paper", "paper"], "wrong": [1, 0]})) == ()


def test_swept_values_read_as_they_were_typed() -> None:
    table = write_swept(
        pd.DataFrame({"noise": [0.01, float("nan")], "count": [4, 8], "recall": [0.1, 0.2]}), ("noise", "count")
    )
    assert table["noise"].tolist() == ["0.01", "-"]
    assert table["count"].tolist() == ["4", "8"]
    assert table["recall"].tolist() == [0.1, 0.2]


def test_numbers_are_short_however_large() -> None:
    values = (0.0, 1.5, 1234.4, 4.2e300, -3.0, 2.0e6, float("nan"), None)
    assert [format_value(v) for v in values] == ["0", "1.50", "1234", "4.20e+300", "-3", "2.00e+06", "-", "-"]


@pytest.mark.parametrize(
    ("hard_is_high", "expected"), [(True, "2.2 (1 already to nowhere)"), (False, "3 already (3 already to 2.5)")]
)
def test_a_breaking_point_lies_between_those_of_the_ends_of_its_intervals(hard_is_high: bool, expected: str) -> None:
    shares = {"success": [1.0, 1.0, 0.5], "success_low": [0.6, 0.6, 0.2], "success_high": [1.0, 1.0, 0.9]}
    if not hard_is_high:
        shares["success_high"] = [0.6, 0.8, 1.0]
    curve = pd.DataFrame({"method": ["paper"] * 3, "noise": [1.0, 2.0, 3.0], "runs": [5, 4, 5], **shares})
    table = breaking_points(curve, "noise", hard_is_high)
    assert table["below 90 % at"].tolist() == [expected]
    assert table["runs a point"].tolist() == ["4 to 5"]
