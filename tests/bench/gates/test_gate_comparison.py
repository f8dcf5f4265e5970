from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.gates.comparison import compare_rows
from bench.gates.rows import GateRow, make_row
from bench.gates.tolerances import HIGHER, LOWER, TOLERANCES, Tolerance, change_tolerances

GOOD = {
    "num_maps": 8.0,
    "num_placed": 8.0,
    "num_wrong": 0.0,
    "success": 1.0,
    "max_error_m": 0.02,
    "median_error_m": 0.008,
    "objective": 0.3,
    "edge_precision": 1.0,
    "edge_recall": 0.9,
    "runtime_ratio": 1000.0,
    "peak_memory_mb": 180.0,
}


def row(seed=0, method="paper", status="ok", reason=None, **scores):
    names = {"dataset": "intel", "world": "intel", "method": method, "seed": seed, "order": 0}
    return make_row(names, status, reason, (GOOD | scores) if status == "ok" else {})


def worse(before, after, tolerances=TOLERANCES):
    return [(f.score, f.seeds) for f in compare_rows(before, after, tolerances).findings]


def scores_of(seed, values):
    return make_row({"dataset": "d", "method": "m", "seed": seed}, "ok", None, values)


@given(st.lists(st.dictionaries(st.sampled_from([t.score for t in TOLERANCES]), st.floats(0, 1e4)), max_size=4))
def test_a_run_is_never_worse_than_itself(values):
    rows = [scores_of(seed, scores) for seed, scores in enumerate(values)]
    assert compare_rows(rows, rows).findings == ()


@given(st.floats(0, 100), st.floats(0, 100), st.sampled_from([HIGHER, LOWER]))
def test_of_two_different_values_exactly_one_direction_is_worse_without_tolerance(a, b, better):
    table = (Tolerance("objective", better),)
    there = compare_rows([scores_of(0, {"objective": a})], [scores_of(0, {"objective": b})], table).findings
    back = compare_rows([scores_of(0, {"objective": b})], [scores_of(0, {"objective": a})], table).findings
    assert len(there) + len(back) == (abs(a - b) > 1e-9)


@pytest.mark.parametrize("tolerance", TOLERANCES, ids=lambda t: t.score)
def test_every_score_of_the_table_turns_worse_just_beyond_its_tolerance(tolerance):
    name = "num_placed" if tolerance.score == "num_right" else tolerance.score
    before = {"num_wrong": 0.0, name: 1.0}
    sign = -1 if tolerance.better == HIGHER else 1
    within = before | {name: 1.0 + sign * tolerance.allowed(1.0)}
    beyond = before | {name: 1.0 + sign * (tolerance.allowed(1.0) + 1e-6)}
    assert worse([scores_of(0, before)], [scores_of(0, within)], (tolerance,)) == []
    assert worse([scores_of(0, before)], [scores_of(0, beyond)], (tolerance,)) == [(tolerance.score, "seed 0")]


def test_a_wrong_map_is_worse_and_the_message_names_all_that_is_known():
    found = compare_rows([row(), row(1)], [row(), row(1, num_wrong=1.0, success=0.0, max_error_m=0.9)]).findings
    assert {f.score for f in found} == {"num_wrong", "num_right", "success", "max_error_m"}
    message = next(f.message for f in found if f.score == "max_error_m")
    assert message == "intel x paper, seed 1: max_error_m got worse: 0.02 -> 0.9 (tolerance 0.01)"


def test_seeds_are_paired_so_that_a_swap_between_them_is_seen():
    easy_then_hard = [row(0, max_error_m=0.01), row(1, max_error_m=0.5)]
    swapped = [row(0, max_error_m=0.5), row(1, max_error_m=0.01)]
    assert worse(easy_then_hard, swapped) == [("max_error_m", "seed 0")]


def test_a_small_drift_is_forgiven_to_one_seed_but_not_to_twenty():
    drift = {"median_error_m": 0.008 + 0.002}
    one, many = [row()], [row(seed) for seed in range(20)]
    assert worse(one, [row(**drift)]) == []
    assert worse(many, [row(seed, **drift) for seed in range(20)]) == [("median_error_m", "mean of 20 seeds")]


def test_luck_that_goes_both_ways_is_forgiven():
    after = [row(seed, median_error_m=0.008 + 0.002 * (-1) ** seed) for seed in range(20)]
    assert worse([row(seed) for seed in range(20)], after) == []


def test_time_is_judged_by_the_median_of_a_cell():
    before = [row(seed) for seed in range(5)]
    one_slow = [row(seed, runtime_ratio=9000.0 if seed == 0 else 1000.0) for seed in range(5)]
    all_slow = [row(seed, runtime_ratio=2100.0) for seed in range(5)]
    assert worse(before, one_slow) == []
    assert worse(before, all_slow) == [("runtime_ratio", "median of 5 seeds")]


def test_a_run_without_a_reference_workload_is_not_judged_by_its_time():
    slow = row(runtime_s=1e6)
    bare = replace(slow, scores={k: v for k, v in slow.scores.items() if k != "runtime_ratio"})
    assert worse([row(runtime_s=1.0)], [bare]) == []


def test_other_data_under_the_same_name_are_noticed():
    assert compare_rows([row(objective_floor=0.3)], [row(objective_floor=0.3001)]).other_data == ()
    assert compare_rows([row(objective_floor=0.3)], [row(objective_floor=0.31)]).other_data == ("intel x paper",)


def test_on_other_data_counts_are_judged_and_fine_scores_are_not():
    before, after = row(objective_floor=0.3), row(objective_floor=0.4, objective=0.4, max_error_m=0.3, num_wrong=1.0)
    assert worse([before], [after]) == [("num_wrong", "seed 0"), ("num_right", "seed 0")]


def test_times_are_told_by_method_whether_they_are_judged_or_not():
    now = [row(runtime_ratio=1500.0), row(method="robust", runtime_ratio=500.0)]
    assert dict(compare_rows([row(), row(method="robust")], now).times) == {
        "paper": "1.50 times the baseline's, relative to the reference workload",
        "robust": "0.50 times the baseline's, relative to the reference workload",
    }


def test_a_missing_row_is_worse():
    assert worse([row(0), row(1)], [row(0)]) == [("status", "seed 1")]


@pytest.mark.parametrize("status", ["failed", "skipped"])
def test_a_row_that_was_ok_and_is_not_is_worse_and_its_reason_is_told(status):
    found = compare_rows([row()], [row(status=status, reason="crashed with SIGSEGV")]).findings
    assert [f.score for f in found] == ["status"]
    assert "crashed with SIGSEGV" in found[0].message


def test_a_failure_that_was_one_before_is_not_worse_and_the_cell_says_so():
    failed = row(status="failed", reason="time limit of 5 s")
    comparison = compare_rows([failed], [failed])
    assert comparison.findings == ()
    assert comparison.cells[0].skipped == "time limit of 5 s"
    assert worse([failed], [row()]) == []


def test_a_cell_that_the_baseline_does_not_know_is_named_and_not_judged():
    comparison = compare_rows([row()], [row(), row(method="mine", num_wrong=8.0)])
    assert comparison.findings == ()
    assert comparison.new == ("intel x mine",)


def test_a_score_that_is_no_longer_known_is_worse():
    bare = replace(row(), scores={k: v for k, v in row().scores.items() if k != "edge_precision"})
    assert worse([row()], [bare]) == [("edge_precision", "seed 0")]


def test_leaving_out_what_was_placed_wrong_is_not_worse():
    wrong = row(num_placed=2.0, num_wrong=2.0, success=0.0, max_error_m=9.0)
    nothing = replace(row(num_placed=0.0, success=0.0), scores={"num_placed": 0.0, "num_wrong": 0.0, "num_right": 0.0})
    assert worse([replace(wrong, scores=wrong.scores | {"success": 0.0})], [nothing]) == []


def test_how_far_off_a_wrong_map_lies_is_not_judged_but_how_many_are():
    before = row(num_wrong=1.0, success=0.0, max_error_m=5.0, objective=7.0)
    assert worse([before], [row(num_wrong=1.0, success=0.0, max_error_m=50.0, objective=900.0)]) == []
    assert worse([before], [row(num_wrong=2.0, success=0.0)]) == [("num_wrong", "seed 0"), ("num_right", "seed 0")]


def test_better_scores_are_not_worse():
    better = row(max_error_m=0.0, objective=0.1, edge_recall=1.0, runtime_ratio=1.0)
    assert worse([row()], [better]) == []


def test_a_tolerance_can_be_changed_and_an_unknown_one_is_refused():
    table = change_tolerances({"max_error_m": 1.0})
    assert worse([row()], [row(max_error_m=0.9)], table) == []
    with pytest.raises(ValueError, match="no tolerance for 'beauty'"):
        change_tolerances({"beauty": 1.0})
    with pytest.raises(ValueError, match="absolute must be >= 0, got -1"):
        change_tolerances({"success": -1.0})


def test_rows_know_how_many_maps_are_placed_right():
    assert row(num_placed=7.0, num_wrong=2.0).scores["num_right"] == 5.0
    assert isinstance(row(), GateRow)
