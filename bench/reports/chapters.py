"""The chapters of a report: which tables and pictures an experiment deserves, and the sentences beside them."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from bench.reports import curves, fidelity, paper_claims, paper_tables, robust_tables
from bench.reports.exhibit import Exhibit, first_of_each, load_exhibit
from bench.reports.fidelity_comparison import compare_fidelity
from bench.reports.picture_chapters import error_chapter, gallery_chapter, picture_chapters
from bench.reports.report import Section
from bench.reports.summary import best_cells, summary_table, tell_overview
from bench.reports.tables import Results, write_swept
from bench.scoring import order_metrics
from bench.scoring.score_rows import PairScore
from bench.settings import BenchSettings
from bench.stages import ScoredCell
from sim.config import SourceKind
from sim.datasets.dataset import read_dataset

MAX_EXHIBITS = 12
"""Results that are drawn, so that a sweep of thousands still gives a report that one can open."""


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
        return summary_table(results, ["method"]), []
    varied = [key for key in results.swept if results.scores[key].nunique(dropna=False) > 1]
    return summary_table(results, ["dataset", *varied, "method"]), []


def make_chapters(
    settings: BenchSettings, results: Results, cells: Sequence[ScoredCell], folder: Path
) -> list[Section]:
    """All chapters, in order; pictures are written into a folder as they are drawn."""
    start = time.perf_counter()
    table, sentences = main_table(settings, results, cells)
    points = tuple(paper_claims.first_words(sentences))
    chapters = [Section("Results", table=table, best=best_cells(table), points=points)]
    if settings.table in ("table1", "table2", "ablation", "fidelity", "robust"):
        summary = summary_table(results, ["dataset", "method"])
        chapters.append(
            Section("Summary", "Medians over runs; counts are sums.", table=summary, best=best_cells(summary))
        )
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
    explanation = robust_tables.EXPLANATION if settings.table == "robust" else ""
    chapters[0] = replace(chapters[0], text=tell_overview(results, time.perf_counter() - start) + explanation)
    return [c for c in chapters if c.table is not None or c.pictures]


_ORDER_TEXT = (
    "Largest difference between the relations of any two maps under two orders; it needs no truth. The sets of placed "
    "maps ought to be the same."
)


_BREAKING_TEXT = (
    "Where success, coming from the easy end, falls below 90 % and below 50 %: the breaking points. In brackets: where "
    "the lower and the upper ends of its 95 % intervals do."
)


def _sweep_chapters(settings: BenchSettings, results: Results, folder: Path) -> list[Section]:
    chapters = []
    varied = [key for key in results.swept if results.scores[key].nunique() > 1]
    for key in varied:
        others = ", ".join(other for other in varied if other != key)
        text = _BREAKING_TEXT + (f" A point takes the runs of all values of {others} together." if others else "")
        curve = curves.success_curve(results, key)
        table = None
        if pd.api.types.is_numeric_dtype(curve[key]):
            table = curves.breaking_points(curve, key, settings.hard_is_high.get(key, True))
        pictures = (curves.draw_success(curve, key, folder), curves.draw_costs(results, key, folder))
        chapters.append(Section(f"Breaking points: {key}", text, tuple(p for p in pictures if p), table))
    return chapters


def _failed_runs(results: Results) -> pd.DataFrame:
    bad = results.scores[results.scores["status"] != "ok"]
    return write_swept(bad[["dataset", *results.swept, "method", "seed", "status", "reason"]], results.swept)


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
