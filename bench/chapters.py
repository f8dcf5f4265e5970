"""The chapters of a report: which tables and pictures an experiment deserves, and the sentences beside them."""

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from bench import curves, fidelity, order_metrics, paper_tables, robust_tables
from bench.exhibit import Exhibit, first_of_each, load_exhibit
from bench.fidelity_comparison import compare_fidelity
from bench.picture_chapters import error_chapter, gallery_chapter, picture_chapters
from bench.report import Section
from bench.scores import PairScore
from bench.settings import BenchSettings
from bench.stages import ScoredCell
from bench.tables import Results, format_value, summarize
from sim.config import SourceKind
from sim.datasets.dataset import read_dataset

MAX_EXHIBITS = 12
"""Results that are drawn, so that a sweep of thousands still gives a report that one can open."""
_SHORT = {
    "runs": "runs",
    "success": "success",
    "success_low": "low",
    "success_high": "high",
    "num_maps": "maps",
    "num_placed": "placed",
    "num_wrong": "wrong",
    "max_error_m": "worst m",
    "median_error_m": "median m",
    "median_error_deg": "median deg",
    "objective_initial": "Obj. coarse",
    "objective": "Obj. fine",
    "objective_floor": "Obj. floor",
    "edge_precision": "precision",
    "edge_recall": "recall",
    "runtime_s": "T(s)",
    "peak_memory_mb": "MiB",
}
_BEST_HIGH = ("success", "placed", "precision", "recall")
_BEST_LOW = ("wrong", "worst m", "median m", "median deg")


def main_table(
    settings: BenchSettings, results: Results, cells: Sequence[ScoredCell]
) -> tuple[pd.DataFrame, list[str]]:
    """The table that the experiment is about, and the sentences below it."""
    if settings.table == "table1":
        return paper_tables.make_table1(results)
    if settings.table == "table2":
        return paper_tables.make_table2(results)
    if settings.table == "robust":
        return robust_tables.make_robust_table(results)
    if settings.table == "fidelity":
        return _fidelity_table(cells)
    if settings.table == "ablation":
        return _summary(results, ["method"]), []
    varied = [key for key in results.swept if results.scores[key].nunique(dropna=False) > 1]
    return _summary(results, ["dataset", *varied, "method"]), []


def make_chapters(
    settings: BenchSettings, results: Results, cells: Sequence[ScoredCell], folder: Path
) -> list[Section]:
    """All chapters, in order; pictures are written into a folder as they are drawn."""
    table, sentences = main_table(settings, results, cells)
    points = tuple(paper_tables.first_words(sentences))
    chapters = [Section("Results", _overview(results), table=table, best=_best(table), points=points)]
    if settings.table in ("table1", "table2", "ablation", "fidelity", "robust"):
        summary = _summary(results, ["dataset", "method"])
        chapters.append(Section("Summary", "Medians over runs; counts are sums.", table=summary, best=_best(summary)))
    chapters += _sweep_chapters(settings, results, folder)
    if settings.orders:
        chapters.append(Section("Order", _ORDER_TEXT, table=_order_table(cells)))
    exhibits = [e for e in map(load_exhibit, first_of_each(cells)[:MAX_EXHIBITS]) if e]
    rivals, merged, pairs = picture_chapters(exhibits, folder)
    chapters += [rivals, merged, error_chapter(results, folder), pairs]
    failures = _failed_runs(results)
    if not failures.empty:
        chapters.append(Section("Runs without an answer", "What ended them.", table=failures))
    chapters.append(gallery_chapter(cells, folder))
    return [c for c in chapters if c.table is not None or c.pictures]


_ORDER_TEXT = (
    "Largest difference between the relations of any two maps under two orders; it needs no truth. The sets of placed "
    "maps ought to be the same."
)


def _summary(results: Results, by: Sequence[str]) -> pd.DataFrame:
    table = summarize(results, by)[[*by, *_SHORT]].rename(columns=_SHORT)
    return _as_typed(table, results.swept)


def _as_typed(table: pd.DataFrame, swept: Sequence[str]) -> pd.DataFrame:
    """A table in which swept values read as one would type them: 0.1, where a score is 0.100."""
    typed = {
        key: [f"{v:g}" if isinstance(v, float) and math.isfinite(v) else format_value(v) for v in table[key]]
        for key in swept
        if key in table
    }
    return table.assign(**typed)


def _overview(results: Results) -> str:
    scores = results.scores
    maps, wrong = int(scores["num_maps"].sum()), int(scores["num_wrong"].sum())
    return (
        f"{len(scores)} runs with {maps} maps; {wrong} maps are placed wrong: more than 0.5 m or 2° from where they "
        "belong in the frame that fits most of their component. Success: every map is placed in one component and none "
        "is wrong; low and high are its 95 % interval (Wilson). Obj. is in cells²; its floor is its value under the "
        "true motions, where it ranks nothing." + _overhead(results)
    )


def _overhead(results: Results) -> str:
    """How much time the bench itself took, in a sentence; empty where no method ran."""
    method_s, bench_s = (float(results.scores[name].sum()) for name in ("runtime_s", "runtime_overhead_s"))
    if not method_s > 0.0:
        return ""
    share = format_value(100.0 * bench_s / method_s)
    return (
        f" Beside the methods' {format_value(method_s)} s the bench took {share} % for itself (datasets not counted)."
    )


def _best(table: pd.DataFrame) -> tuple[tuple[int, str], ...]:
    """Cells with the best value among the methods of one dataset, where there is something to choose."""
    if "method" not in table or table["method"].nunique() < 2:
        return ()
    keys = list(table.columns[: list(table.columns).index("method")])
    groups = [g for _, g in table.groupby(keys, sort=False, dropna=False)] if keys else [table]
    marks = []
    for group in groups:
        for name in (*_BEST_HIGH, *_BEST_LOW):
            values = pd.to_numeric(group[name], errors="coerce") if name in group else pd.Series(dtype=float)
            if values.nunique() > 1:
                best = values.max() if name in _BEST_HIGH else values.min()
                marks += [(int(index), name) for index in values.index[values == best]]
    return tuple(marks)


def _sweep_chapters(settings: BenchSettings, results: Results, folder: Path) -> list[Section]:
    chapters = []
    for key in results.swept:
        if results.scores[key].nunique() < 2:
            continue
        curve = curves.success_curve(results, key)
        table = None
        if pd.api.types.is_numeric_dtype(curve[key]):
            table = curves.breaking_points(curve, key, settings.hard_is_high.get(key, True))
        text = "Where success, coming from the easy end, falls below 90 % and below 50 %: the breaking points."
        chapters.append(Section(f"Breaking points: {key}", text, (curves.draw_success(curve, key, folder),), table))
    return chapters


def _failed_runs(results: Results) -> pd.DataFrame:
    bad = results.scores[results.scores["status"] != "ok"]
    return _as_typed(bad[["dataset", *results.swept, "method", "seed", "status", "reason"]], results.swept)


def _order_table(cells: Sequence[ScoredCell]) -> pd.DataFrame:
    groups: dict[tuple[str, str, int], list[Exhibit]] = {}
    for exhibit in filter(None, map(load_exhibit, cells)):
        key = (exhibit.label, exhibit.method, exhibit.scored.cell.seed)
        groups.setdefault(key, []).append(exhibit)
    rows = []
    for (label, method, seed), group in groups.items():
        found = order_metrics.compare_orders([e.prediction for e in group])
        rows.append(
            {
                "dataset": label,
                "method": method,
                "seed": seed,
                "orders": len(group),
                "same maps placed": found.same_placed,
                "difference m": found.difference_m,
                "difference deg": found.difference_deg,
            }
        )
    return pd.DataFrame(rows)


def _fidelity_table(cells: Sequence[ScoredCell]) -> tuple[pd.DataFrame, list[str]]:
    """Statistics of every dataset over its runs."""
    runs: dict[str, list[fidelity.FidelityRun]] = {}
    for scored in cells:
        if scored.score["status"] == "ok":
            pairs = [PairScore(**pair) for pair in scored.pairs]
            run = fidelity.FidelityRun(read_dataset(scored.dataset), pairs, scored.score["median_error_m"])
            runs.setdefault(scored.cell.dataset.label, []).append(run)
    kinds = {scored.cell.dataset.label: scored.cell.dataset.config.source.kind for scored in cells}
    real = [label for label in runs if kinds[label] is SourceKind.CARMEN]
    statistics = {label: fidelity.measure_fidelity(found) for label, found in runs.items()}
    return compare_fidelity(statistics, real)
