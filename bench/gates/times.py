"""How much slower or faster each method became, in words: for the reader, beside what the gate judges."""

import math
import statistics
from collections.abc import Iterator, Mapping, Sequence

from bench.gates.rows import CellName, GateRow

_RATIO, _WALL = "runtime_ratio", "runtime_s"


def describe_times(before: Sequence[GateRow], now: Mapping[tuple[CellName, int], GateRow]) -> Iterator[tuple[str, str]]:
    """Each method and the median factor of its times, over the rows that both runs have.

    Times are ratios to the reference workload; where a run did not record it, they are seconds, and say so.
    """
    methods = dict.fromkeys(str(dict(row.cell).get("method")) for row in before)
    for method in methods:
        rows = [row for row in before if dict(row.cell).get("method") == method]
        ratios, seconds = ([*_factors(rows, now, name)] for name in (_RATIO, _WALL))
        if ratios:
            yield method, f"{statistics.median(ratios):.2f} times the baseline's, relative to the reference workload"
        elif seconds:
            yield method, f"{statistics.median(seconds):.2f} times the baseline's in seconds, not judged"


def _factors(rows: Sequence[GateRow], now: Mapping[tuple[CellName, int], GateRow], name: str) -> Iterator[float]:
    for row in rows:
        new = now.get((row.cell, row.seed))
        old_value, new_value = row.scores.get(name, 0.0), new.scores.get(name, math.nan) if new else math.nan
        if old_value > 0.0 and math.isfinite(new_value):
            yield new_value / old_value
