"""The chapters of a report: which tables and pictures an experiment deserves, and the sentences beside them."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from bench.reports import curves, fidelity, paper_claims, paper_tables, robust_tables
from bench.reports.exhibit import Exhibit, first_of_each, load_exhibit
from bench.reports.failed_runs import failed_runs
from bench.reports.fidelity_comparison import EXPLANATION, compare_fidelity
from bench.reports.picture_chapters import error_chapter, gallery_chapter, picture_chapters
from bench.reports.report import MAX_ROWS, Section
from bench.reports.summary import best_cells, summary_table, tell_overview
from bench.reports.tables import Results, first_orders
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
        table, sentences = paper_tables.make_table1(results)
        return table, paper_claims.first_words(sentences)
    if settings.table == "table2":
        table, sentences = paper_tables.make_table2(results)
        return table, paper_claims.first_words(sentences)
    if settings.table == "robust":
        return robust_tables.make_robust_table(results)
    if settings.table == "fidelity":
        return _fidelity_table(results, cells)
    if settings.table == "ablation":
        return summary_table(results, ["method"]), []
    varied = _varied_keys(results)
    labels = ["dataset"] if results.scores["dataset"].nunique() > 1 or not varied else []
    return summary_table(results, [*labels, *varied, "method"]), []


def make_chapters(
    settings: BenchSettings, results: Results, cells: Sequence[ScoredCell], folder: Path
) -> tuple[pd.DataFrame, list[str], list[Section]]:
    """The main table, the sentences below it, and all chapters; pictures are written into a folder as they are drawn.

    What most readers come for stands first; what there is one of for each dataset comes last, and folded.
    """
    start = time.perf_counter()
    table, sentences = main_table(settings, results, cells)
    chapters = [*_first_chapters(settings, results, table, sentences), *_sweep_chapters(settings, results, folder)]
    short = summary_table(results, ["method"])
    if len(table) > MAX_ROWS and len(short) < len(table) and settings.table == "summary":
        chapters[0] = replace(chapters[0], table=short, best=best_cells(short))
        chapters.append(Section("Every point", _POINTS_TEXT, table=table, best=best_cells(table), folded=True))
    if settings.orders:
        chapters.append(Section("Order", _ORDER_TEXT, table=_order_table(cells)))
    exhibits = [e for e in map(load_exhibit, first_of_each(cells)[:MAX_EXHIBITS]) if e]
    rivals, *singles = picture_chapters(exhibits, folder)
    pictures = [error_chapter(first_orders(results), folder), gallery_chapter(cells, folder)]
    pictures.insert(len(pictures) if _varied_keys(results) else 0, rivals)
    chapters += [failed_runs(results, cells), *pictures, *singles]
    explanation = {"robust": robust_tables.EXPLANATION, "fidelity": EXPLANATION}.get(settings.table, "")
    chapters[0] = replace(chapters[0], text=tell_overview(results, time.perf_counter() - start) + explanation)
    return table, sentences, [c for c in chapters if c.table is not None or c.pictures]


def _varied_keys(results: Results) -> list[str]:
    """Swept keys that have more than one value."""
    return [key for key in results.swept if results.scores[key].nunique(dropna=False) > 1]


def _first_chapters(
    settings: BenchSettings, results: Results, table: pd.DataFrame, sentences: list[str]
) -> list[Section]:
    """The main table, and a summary beside a table that has columns of its own."""
    chapters = [Section("Results", table=table, best=best_cells(table), points=tuple(sentences))]
    same = settings.table == "ablation" and results.scores["dataset"].nunique() == 1
    if settings.table != "summary" and not same:
        summary = summary_table(first_orders(results), ["dataset", "method"])
        text = f"Medians over runs{' of the first order' if settings.orders else ''}; counts are sums."
        folded = len(summary) > MAX_ROWS
        chapters.append(Section("Summary", text, table=summary, best=best_cells(summary), folded=folded))
    return chapters


_POINTS_TEXT = "Each dataset and swept value by itself; medians over its runs, counts are sums."

_ORDER_TEXT = (
    "Largest difference between the relations of any two maps under two orders; it needs no truth. The sets of placed "
    "maps ought to be the same."
)


_BREAKING_TEXT = (
    "Where success, coming from the easy end, first falls below 90 % and below 50 %: the breaking points, on straight "
    "lines between the swept values. In brackets: where the lower and the upper ends of its 95 % intervals do. "
    "Already: at the easiest value; nowhere: at no value that was swept."
)


def _sweep_chapters(settings: BenchSettings, results: Results, folder: Path) -> list[Section]:
    """Success and costs against each swept key; of numbers the breaking points, too."""
    chapters = []
    datasets = ["datasets"] if results.scores["dataset"].nunique() > 1 else []
    varied = _varied_keys(results)
    for key in varied:
        others = ", ".join([*datasets, *(f"values of {other}" for other in varied if other != key)])
        together = f" A point takes the runs of all {others} together." if others else ""
        curve = curves.success_curve(results, key)
        if curve.empty:
            continue
        title, text, table = f"Success by {key}", "Words are in no order, and have no breaking point.", None
        if curves.is_number(curve[key]):
            hard_is_high = settings.hard_is_high.get(key, True)
            easy = f" {'Small' if hard_is_high else 'Large'} values are taken to be the easy ones (hard_is_high)."
            title, text = f"Breaking points: {key}", _BREAKING_TEXT + easy
            table = curves.breaking_points(curve, key, hard_is_high)
        pictures = (curves.draw_success(curve, key, folder), curves.draw_costs(results, key, folder))
        chapters.append(Section(title, text + together, tuple(p for p in pictures if p), table))
    return chapters


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


def _fidelity_table(results: Results, cells: Sequence[ScoredCell]) -> tuple[pd.DataFrame, list[str]]:
    """Statistics of every dataset over its runs; the usual table where no run gave an answer."""
    runs: dict[str, list[fidelity.FidelityRun]] = {}
    for scored in cells:
        if scored.score["status"] == "ok":
            pairs = [PairScore(**pair) for pair in scored.pairs]
            run = fidelity.FidelityRun(read_dataset(scored.dataset), pairs, scored.score["median_error_m"])
            runs.setdefault(scored.cell.dataset.label, []).append(run)
    if not runs:
        return summary_table(results, ["dataset", "method"]), []
    kinds = {scored.cell.dataset.label: scored.cell.dataset.config.source.kind for scored in cells}
    real = [label for label in runs if kinds[label] is SourceKind.CARMEN]
    statistics = {label: fidelity.measure_fidelity(found) for label, found in runs.items()}
    return compare_fidelity(statistics, real)
