"""Baselines on disk: the scores that a merger once reached, sorted, one row a line, so that a change can be read."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.gates.comparison import FINGERPRINT
from bench.gates.rows import CellName, GateRow, Value, check_unique, make_row
from bench.gates.tolerances import COSTS, TOLERANCES
from bench.store import write_text

SCHEMA = 1
"""Version of the layout."""

_KEPT = ("num_maps", "num_placed", *(t.score for t in TOLERANCES if t.score != "num_right"), FINGERPRINT, "runtime_s")
_DIGITS = 6


def write_baseline(path: Path, rows: Sequence[GateRow], *, costs: bool = True) -> None:
    """Write a baseline, whole or not at all; the same scores give the same bytes.

    Args:
        path: The file to write.
        rows: Its rows, in any order.
        costs: Whether to keep time and memory, which depend on the machine.
    """
    kept = _KEPT if costs else tuple(name for name in _KEPT if name not in (*COSTS, "runtime_s"))
    lines = [json.dumps(_document(row, kept)) for row in sorted(rows, key=_sort_key)]
    text = f'{{"schema": {SCHEMA}, "rows": [\n' + ",\n".join(lines) + "\n]}\n"
    write_text(path, text)


def read_baseline(path: Path) -> list[GateRow]:
    """Read a baseline.

    Raises:
        ValueError: there is none, it is malformed, or it names a row twice.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such baseline; --update (in pytest --merge-gate-update) makes it") from None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no baseline ({' '.join(str(error).split())})") from None
    rows = document.get("rows") if isinstance(document, dict) and document.get("schema") == SCHEMA else None
    if not isinstance(rows, list) or not rows:
        raise ValueError(f"{path}: no baseline: it needs schema {SCHEMA} and rows")
    return check_unique([_row(entry, path) for entry in rows], str(path))


def _document(row: GateRow, kept: Sequence[str]) -> dict[str, Any]:
    scores = {name: _rounded(row.scores[name]) for name in kept if name in row.scores}
    reason = {"reason": row.reason} if row.reason else {}
    return {"cell": dict(_named_first(row.cell)), "seed": row.seed, "status": row.status, **reason, "scores": scores}


def _row(entry: object, path: Path) -> GateRow:
    try:
        if not isinstance(entry, dict):
            raise TypeError("a row must be an object")
        names: dict[str, Value] = {**entry["cell"], "seed": int(entry["seed"])}
        if any(isinstance(value, (list, dict)) for value in names.values()):
            raise TypeError("a cell is named by plain values")
        scores = {str(name): float(value) for name, value in entry["scores"].items()}
        return make_row(names, str(entry["status"]), entry.get("reason"), scores)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{path}: malformed row ({type(error).__name__}: {error})") from None


def _rounded(value: float) -> float:
    number = float(f"{value:.{_DIGITS}g}")
    return int(number) if number.is_integer() else number


def _sort_key(row: GateRow) -> tuple[str, int]:
    return json.dumps(_named_first(row.cell)), row.seed


def _named_first(cell: CellName) -> CellName:
    """A cell with dataset and method before what else names it, as a person looks for it."""
    first = {"dataset": 0, "method": 1}
    return tuple(sorted(cell, key=lambda item: (first.get(item[0], 2), item[0])))
