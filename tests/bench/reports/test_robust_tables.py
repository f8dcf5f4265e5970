import pandas as pd
import pytest

from bench.reports.robust_tables import (
    connected_maps,
    make_robust_table,
    pair_sentence,
    placement_columns,
    time_sentences,
)
from bench.reports.tables import Results
from bench.scoring.statistics import wilson_share

RUN = {"dataset": "office", "seed": 0, "order": 0, "submaps.overlap": 0.3}


def a_pair(target, source, overlap, status="reliable", **changes):
    row = {"method": "robust", "target": target, "source": source, "overlap_true": overlap, "status": status}
    return RUN | row | {"right": True} | changes


def a_map(name, placed=True, wrong=False, error_m=0.01, method="robust", **changes):
    row = {"method": method, "map": name, "placed": placed, "wrong": wrong, "error_m": error_m, "error_deg": 0.1}
    return RUN | row | changes


def a_run(method, runtime_s, **changes):
    return RUN | {"method": method, "status": "ok", "runtime_s": runtime_s} | changes


def test_a_map_can_be_placed_if_it_overlaps_another_in_the_better_direction():
    pairs = pd.DataFrame([a_pair("a", "b", 0.2), a_pair("b", "c", 0.19), a_pair("c", "d", 0.5, seed=1)])
    found = connected_maps(pairs, list(RUN))
    assert sorted(zip(found["seed"], found["map"], strict=True)) == [(0, "a"), (0, "b"), (1, "c"), (1, "d")]


def test_two_methods_that_name_the_same_pair_make_a_map_possible_once():
    pairs = pd.DataFrame([a_pair("a", "b", 0.4), a_pair("a", "b", 0.4, method="paper")])
    assert len(connected_maps(pairs, list(RUN))) == 2


def test_placements_are_counted_and_accuracy_is_of_what_is_right():
    maps = pd.DataFrame(
        [
            a_map("a", error_m=0.01, possible=True),
            a_map("b", error_m=0.03, possible=True),
            a_map("c", wrong=True, error_m=9.0, possible=True),
            a_map("d", placed=False, error_m=None, possible=None),
        ]
    )
    columns = placement_columns(maps)
    assert (columns["placed"], columns["wrong"], columns["can be"], columns["right"]) == (3, 1, 3, 2)
    assert columns["worst m"] == 0.03
    assert columns["median m"] == pytest.approx(0.02)
    assert columns["at most %"] == pytest.approx(100 * wilson_share(1, 3).high)
    assert columns["at least %"] == pytest.approx(100 * wilson_share(2, 3).low)


def test_false_accepts_are_reliable_motions_between_maps_that_have_nothing_in_common():
    pairs = [a_pair("a", "b", 0.35), a_pair("a", "c", 0.35, status="rejected"), a_pair("b", "c", 0.0, right=False)]
    sentence = pair_sentence("robust", pd.DataFrame([*pairs, a_pair("a", "d", 0.0, status="no_match", right=False)]))
    assert "0.3-0.5: 0.500 of 2" in sentence
    assert "0.5-1" not in sentence
    assert "false accepts 1 of 2" in sentence
    assert pair_sentence("stitcher", pd.DataFrame(pairs)) is None


def test_times_are_paired_by_their_data():
    runs = [a_run("paper", 2.0), a_run("robust", 3.0), a_run("paper", 10.0, seed=1), a_run("robust", 15.0, seed=1)]
    (sentence,) = time_sentences(pd.DataFrame([*runs, a_run("robust", 99.0, seed=2)]), list(RUN))
    assert sentence.startswith("robust takes 1.50 times the time of paper (median of 2 runs")


def test_the_table_has_a_row_for_each_dataset_overlap_and_method():
    maps = pd.DataFrame([a_map("a"), a_map("b"), a_map("a", method="paper", wrong=True, error_m=4.0)])
    pairs = pd.DataFrame([a_pair("a", "b", 0.6)])
    scores = pd.DataFrame([a_run("robust", 1.0), a_run("paper", 1.0), a_run("paper", 1.0, **{"submaps.overlap": 0.0})])
    table, sentences = make_robust_table(Results(scores, maps, pairs, ("submaps.overlap",)))
    assert list(table["method"]) == ["robust", "paper", "paper"]
    assert list(table["wrong"][:2]) == [0, 1]
    assert list(table["right"][:2]) == [2, 0]
    assert table["wrong"].isna()[2]
    assert len(sentences) == 2


def test_without_any_answer_there_is_a_table_all_the_same():
    table, sentences = make_robust_table(
        Results(pd.DataFrame([a_run("robust", 1.0)]), pd.DataFrame(), pd.DataFrame(), ())
    )
    assert list(table.columns) == ["dataset", "method", "runs"]
    assert sentences == []
