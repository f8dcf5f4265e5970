"""Rows of ``scores.csv`` as the gate sees them: what names a row, and what is known of it."""

import csv
import io
import math
from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path

from bench.scoring.score_rows import Score

Value = bool | int | float | str | None
"""A value that names a row."""
CellName = tuple[tuple[str, Value], ...]
"""Dataset, world, method, order and swept keys with their values, sorted, as far as they have one."""

REQUIRED = (
    *("dataset", "world", "method", "seed", "status", "reason", "num_maps", "num_placed", "num_wrong", "success"),
    *("max_error_m", "max_error_deg", "median_error_m", "median_error_deg", "objective_initial", "objective"),
    *("edge_precision", "edge_recall", "runtime_s", "peak_memory_mb"),
)
"""Columns that every ``scores.csv`` has."""

_NAMES = ("dataset", "world", "method")
_SCORES = tuple(item.name for item in fields(Score))


@dataclass(frozen=True)
class GateRow:
    """One row of the scores."""

    cell: CellName
    """Its cell; the rows of one cell differ in seed."""
    seed: int
    """Its seed: rows of two runs that agree in cell and seed met the same data and the same noise."""
    status: str
    """``ok``, ``failed`` or ``skipped``."""
    reason: str | None
    """Why it is not ok."""
    scores: dict[str, float]
    """Numbers by column, with ``num_right`` (placed and not wrong); what is not known is left out."""

    @property
    def label(self) -> str:
        """The cell for a person: ``intel x paper [submaps.overlap=0.1]``."""
        return cell_label(self.cell)


def cell_label(cell: CellName) -> str:
    """A cell for a person: ``intel x paper [submaps.overlap=0.1]``."""
    values = dict(cell)
    rest = [f"{k}={v}" for k, v in cell if k not in _NAMES and (k, v) != ("order", 0)]
    return f"{values.get('dataset')} x {values.get('method')}" + (f" [{', '.join(rest)}]" if rest else "")


def read_rows(path: Path) -> list[GateRow]:
    """Read a ``scores.csv``.

    Raises:
        ValueError: there is none, it is empty, lacks a column, holds what is no number, or names a row twice.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # a spreadsheet leaves its mark
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file: not a folder of results") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read ({type(error).__name__})") from None
    table = csv.DictReader(io.StringIO(text))
    missing = [name for name in REQUIRED if name not in (table.fieldnames or ())]
    if missing:
        raise ValueError(f"{path}: no column {', '.join(missing)}")
    rows = [_row(record, f"{path}:{table.line_num}") for record in table]
    if not rows:
        raise ValueError(f"{path}: holds no row")
    return check_unique(rows, str(path))


def check_unique(rows: list[GateRow], source: str) -> list[GateRow]:
    """The rows, if no two have the same name.

    Raises:
        ValueError: two have.
    """
    twice = [key for key, count in Counter((row.cell, row.seed) for row in rows).items() if count > 1]
    if twice:
        raise ValueError(f"{source}: {cell_label(twice[0][0])}, seed {twice[0][1]} is there twice")
    return rows


def make_row(names: dict[str, Value], status: str, reason: str | None, scores: dict[str, float]) -> GateRow:
    """A row from the values that name it, seed included, and its numbers."""
    cell = tuple(sorted((key, value) for key, value in names.items() if key != "seed" and value is not None))
    known = {name: value for name, value in scores.items() if math.isfinite(value)}
    if "num_placed" in known and "num_wrong" in known:
        known["num_right"] = known["num_placed"] - known["num_wrong"]
    return GateRow(cell, int(names["seed"] or 0), status, reason, known)


def _row(record: dict[str, str], place: str) -> GateRow:
    if None in record or None in record.values():
        raise ValueError(f"{place}: the row has not as many fields as the header")
    names: dict[str, Value] = {k: _name(k, v) for k, v in record.items() if k not in _SCORES}
    if not isinstance(names["seed"], int):
        raise ValueError(f"{place}: seed must be an integer, got '{record['seed']}'")
    numeric = [k for k in record if k in _SCORES and k not in ("status", "reason")]
    scores = {key: _number(record[key], f"{place}: {key}") for key in numeric}
    return make_row(names, record["status"], record["reason"] or None, scores)


def _name(key: str, text: str) -> Value:
    """A value that names a row; a whole number is an integer, so that 8 and 8.0 are one."""
    if key in _NAMES:
        return text
    if text == "":
        return None
    if text in ("True", "False"):
        return text == "True"
    try:
        number = float(text)
    except ValueError:
        return text
    return int(number) if number.is_integer() else number


def _number(text: str, place: str) -> float:
    if text in ("True", "False"):
        return float(text == "True")
    try:
        return float(text) if text else math.nan
    except ValueError:
        raise ValueError(f"{place} must be a number, got '{text}'") from None
