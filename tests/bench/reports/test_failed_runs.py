"""Runs without an answer: each reason once, how often, and where to look; what never began does not count."""

from pathlib import Path

import pandas as pd

from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec
from bench.reports.curves import success_curve
from bench.reports.failed_runs import failed_runs
from bench.reports.summary import summary_table, tell_overview
from bench.reports.tables import Results, first_orders, format_swept
from bench.stages import ScoredCell
from sim.config import SimConfig

COLUMNS = (
    *("success_low", "success_high", "max_error_m", "median_error_m", "median_error_deg", "objective_initial"),
    *("objective", "objective_floor", "edge_precision", "edge_recall", "runtime_s", "runtime_overhead_s"),
    "peak_memory_mb",
)


def a_run(seed: int, status: str = "ok", reason: str | None = None, **changes: object) -> dict[str, object]:
    row = dict.fromkeys(COLUMNS, 1.0) | {"dataset": "office", "method": "mine", "seed": seed, "order": 0}
    row |= {"status": status, "reason": reason, "success": status == "ok", "noise": 0.1}
    return row | {"num_maps": 4, "num_placed": 4 if status == "ok" else 0, "num_wrong": 0} | changes


def results(*rows: dict[str, object]) -> Results:
    return Results(pd.DataFrame(rows), pd.DataFrame(), pd.DataFrame(), ("noise",))


def test_each_reason_is_said_once_with_its_number_and_the_first_runs_folder(tmp_path: Path) -> None:
    method = MethodSpec("mine", MethodKind.EXTERNAL, "prog {maps} {out}")
    cells = []
    for seed in range(4):
        answer = tmp_path / "store" / "predictions" / f"key{seed}" / "result.json"
        answer.parent.mkdir(parents=True)
        cell = Cell(DatasetSpec("office", SimConfig()), method, seed)
        cells.append(ScoredCell(cell, {}, [], [], tmp_path / "dataset", answer))
    rows = [a_run(0), a_run(1, "failed", "rare"), a_run(2, "failed", "often"), a_run(3, "failed", "often")]
    table = failed_runs(results(*rows), cells).table
    assert table is not None
    assert table[["reason", "runs", "seed", "folder"]].values.tolist() == [
        ["often", 2, 2, "store/predictions/key2"],
        ["rare", 1, 1, "store/predictions/key1"],
    ]
    assert failed_runs(results(a_run(0)), cells[:1]).table is None


def test_what_never_began_counts_against_no_method() -> None:
    rows = [a_run(0), a_run(1, "failed", "it crashed"), a_run(2, "skipped", "needs x")]
    found = results(*rows, a_run(3, "failed", "dataset: too small"))
    (row,) = summary_table(found, ["method"]).to_dict("records")
    assert (row["runs"], row["success"], row["maps"], row["placed"]) == (2, 0.5, 8, 4)
    assert success_curve(found, "noise")["runs"].tolist() == [2]
    text = tell_overview(found, 1.0)
    assert "Runs: 2, with 8 maps" in text
    assert "gave no answer: 1." in text
    assert "could not begin, and do not count: 2." in text


def test_orders_of_the_same_maps_are_no_further_evidence() -> None:
    rows = [a_run(0, order=order) for order in (1, 2, 3, 4)]
    assert first_orders(results(*rows)).scores["order"].tolist() == [1]
    assert len(first_orders(results(a_run(0), a_run(1))).scores) == 2


def test_curves_keep_the_order_of_the_methods_and_sort_numbers_but_not_words() -> None:
    def swept(*values: object) -> list[tuple[str, object]]:
        rows = [a_run(0, method=name, noise=value) for value in values for name in ("sequential", "paper")]
        curve = success_curve(results(*rows), "noise")
        return list(zip(curve["method"], map(format_swept, curve["noise"]), strict=True))

    for values, shown in (
        ((0.2, 0.1), "0.1 0.2"),
        (("b", "a"), "b a"),
        ((3, None), "3 -"),
        ((True, False), "yes no"),
        (("x", 1), "x 1"),
    ):
        assert swept(*values) == [(name, word) for name in ("sequential", "paper") for word in shown.split()]
