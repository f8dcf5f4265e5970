"""Scores as tables: one row a cell, summaries over seeds, and text for a terminal."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from bench.plan import building_of
from bench.scoring.statistics import wilson_share
from bench.stages import NO_DATASET, ScoredCell
from bench.store import write_bytes, write_text

KEYS = ("dataset", "world", "method", "seed", "order")
"""Columns that name a row; swept keys follow the scores."""


@dataclass(frozen=True)
class Results:
    """What an experiment found."""

    scores: pd.DataFrame
    """One row a cell."""
    maps: pd.DataFrame
    """One row a map of a cell."""
    pairs: pd.DataFrame
    """One row a pair of a cell."""
    swept: tuple[str, ...]
    """Columns that hold swept keys."""


def gather(cells: Sequence[ScoredCell]) -> Results:
    """Finished cells as tables, in their order."""
    swept = tuple(dict.fromkeys(k for c in cells for k, _ in c.cell.dataset.swept if k not in KEYS))
    scores = pd.DataFrame([_key_columns(c) | c.score | _swept_columns(c, swept) for c in cells])
    maps = pd.DataFrame([_key_columns(c) | row | _swept_columns(c, swept) for c in cells for row in c.maps])
    pairs = pd.DataFrame([_key_columns(c) | row | _swept_columns(c, swept) for c in cells for row in c.pairs])
    return Results(scores, maps, pairs, swept)


def write_results(folder: Path, results: Results) -> None:
    """Write ``scores.csv``, ``scores.parquet``, ``maps.csv`` and ``pairs.csv``, each whole or not at all."""
    for name, table in (("scores", results.scores), ("maps", results.maps), ("pairs", results.pairs)):
        write_text(folder / f"{name}.csv", table.to_csv(index=False))
    buffer = io.BytesIO()
    results.scores.to_parquet(buffer, index=False)
    write_bytes(folder / "scores.parquet", buffer.getvalue())


def summarize(results: Results, by: Sequence[str]) -> pd.DataFrame:
    """One row a group: success with its 95 % interval, placed and wrong maps, errors, times.

    Medians are over the runs that gave an answer, of what is known; counts are sums. Runs that never began
    (`rows_that_ran`) do not count.
    """
    rows = []
    for keys, everything in results.scores.groupby(list(by), sort=False, dropna=False):
        group = rows_that_ran(everything)
        share = wilson_share(int(group["success"].astype(bool).sum()), len(group))
        row: dict[str, Any] = dict(zip(by, keys if isinstance(keys, tuple) else (keys,), strict=True))
        row |= {"runs": len(group), "success": share.value, "success_low": share.low, "success_high": share.high}
        row |= {f"{name}": int(group[name].sum()) for name in ("num_maps", "num_placed", "num_wrong")}
        for name in _MEDIANS:
            row[name] = median_of(group.loc[group["status"] == "ok", name])
        rows.append(row)
    return pd.DataFrame(rows)


def rows_that_ran(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of methods that were called: none that was skipped, none whose dataset could not be made."""
    unmade = scores["reason"].astype("string").str.startswith(NO_DATASET).fillna(value=False).astype(bool)
    return scores[(scores["status"] != "skipped") & ~unmade]


def first_orders(results: Results) -> Results:
    """What was found under the first order of the maps: the others repeat its runs, and are no further evidence."""
    if results.scores["order"].nunique() < 2:
        return results
    first = results.scores["order"].min()
    tables = (results.scores, results.maps, results.pairs)
    scores, maps, pairs = (table if table.empty else table[table["order"] == first] for table in tables)
    return Results(scores, maps, pairs, results.swept)


def write_swept(table: pd.DataFrame, swept: Sequence[str]) -> pd.DataFrame:
    """A table in which swept values read as one would type them: 0.1, where a score is 0.100."""
    return table.assign(**{key: list(map(format_swept, table[key])) for key in swept if key in table})


def format_swept(value: object) -> str:
    """A swept value as one would type it."""
    return f"{value:g}" if isinstance(value, float) and math.isfinite(value) else format_value(value)


def format_table(table: pd.DataFrame) -> str:
    """A table for a terminal: aligned columns, short numbers, a dash for what is not known."""
    cells = [list(table.columns), *([format_value(v) for v in row] for row in table.itertuples(index=False))]
    widths = [max(len(row[k]) for row in cells) for k in range(len(table.columns))]
    numeric = [pd.api.types.is_numeric_dtype(table[c]) for c in table.columns]
    lines = []
    for row in cells:
        padded = [t.rjust(w) if n else t.ljust(w) for t, w, n in zip(row, widths, numeric, strict=True)]
        lines.append("  ".join(padded).rstrip())
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def format_value(value: object) -> str:
    """A value for a person: three significant digits, yes and no, a dash for what is not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, (bool,)) or type(value).__name__ == "bool_":
        return "yes" if value else "no"
    if isinstance(value, float):
        if abs(value) < 1e-9:
            return "0"
        if value == int(value) and abs(value) < 1e6:
            return str(int(value))
        return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:#.3g}".rstrip(".")
    return str(value)


_MEDIANS = (
    "max_error_m",
    "median_error_m",
    "median_error_deg",
    "objective_initial",
    "objective",
    "objective_floor",
    "edge_precision",
    "edge_recall",
    "runtime_s",
    "peak_memory_mb",
)


def median_of(column: "pd.Series[Any]") -> float:
    """Median of what is known; NaN where nothing is."""
    known = pd.to_numeric(column, errors="coerce").dropna()
    return float(known.median()) if len(known) else math.nan


def records_of(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a table, each by its columns."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _key_columns(cell: ScoredCell) -> dict[str, Any]:
    return {
        "dataset": cell.cell.dataset.label,
        "world": building_of(cell.cell.dataset),
        "method": cell.cell.method.label,
        "seed": cell.cell.seed,
        "order": cell.cell.order,
    }


def _swept_columns(cell: ScoredCell, swept: Sequence[str]) -> dict[str, Any]:
    values = dict(cell.cell.dataset.swept)
    return {key: values.get(key) for key in swept}
