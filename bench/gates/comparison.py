"""What got worse between two runs of the same cells: seeds are paired, so that the same noise meets both versions."""

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bench.gates.rows import CellName, GateRow, cell_label
from bench.gates.times import describe_times
from bench.gates.tolerances import TOLERANCES, Tolerance

FINGERPRINT = "objective_floor"
"""A score that the data alone decide."""

_SAME_DATA = 5e-3
_ROUNDING = 1e-9
_OK = "ok"


@dataclass(frozen=True)
class Finding:
    """One score of one cell that got worse by more than its tolerance."""

    cell: CellName
    """The cell."""
    seeds: str
    """Which seed, or over which seeds: ``seed 3``, ``mean of 20 seeds``."""
    score: str
    """Name of the score, or ``status``."""
    before: str
    """Value in the baseline."""
    after: str
    """Value now."""
    tolerance: str
    """How much worse it may get."""

    @property
    def message(self) -> str:
        """The finding in one sentence."""
        return (
            f"{cell_label(self.cell)}, {self.seeds}: {self.score} got worse: {self.before} -> {self.after}"
            f" (tolerance {self.tolerance})"
        )


@dataclass(frozen=True)
class CellComparison:
    """One cell of the baseline against the same cell now."""

    cell: CellName
    """The cell."""
    num_pairs: int
    """Seeds that both runs have."""
    findings: tuple[Finding, ...]
    """What got worse."""
    skipped: str | None = None
    """Why nothing could be compared: the baseline itself has no result."""


@dataclass(frozen=True)
class Comparison:
    """Two runs compared."""

    cells: tuple[CellComparison, ...]
    """The cells of the baseline, in its order."""
    new: tuple[str, ...]
    """Labels of cells that the baseline does not know."""
    times: tuple[tuple[str, str], ...]
    """Each method's time in words, judged or not."""
    other_data: tuple[str, ...] = ()
    """Labels of cells whose data are not the baseline's: their score under the true motions differs."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All that got worse."""
        return tuple(finding for cell in self.cells for finding in cell.findings)

    @property
    def without_result(self) -> tuple[str, ...]:
        """Labels of cells in which the baseline itself has no result."""
        return tuple(cell_label(cell.cell) for cell in self.cells if cell.skipped is not None)

    @property
    def num_pairs(self) -> int:
        """Rows that both runs have."""
        return sum(cell.num_pairs for cell in self.cells)


def compare_rows(
    before: Sequence[GateRow], after: Sequence[GateRow], tolerances: Sequence[Tolerance] = TOLERANCES
) -> Comparison:
    """Compare two runs, cell by cell and seed by seed.

    A row that is missing, or failed or skipped where it was ok, is worse. A score of a row is worse beyond its
    tolerance, or when it is no longer known although no fewer maps are wrong. The mean change over a cell's n seeds
    is worse beyond ``1 / sqrt(n)`` of the mean tolerance. Scores with ``each_seed=False`` (time, memory) are compared
    by their cell's median alone, scores with ``fine=True`` where both met the same data and the baseline
    has no wrong map. Rows that the baseline does not know, or knows as failed, are not judged.

    Args:
        before: Rows of the baseline.
        after: Rows of the run in question.
        tolerances: The gate's table.
    """
    now = {(row.cell, row.seed): row for row in after}
    cells: dict[CellName, list[GateRow]] = {}
    for row in before:
        cells.setdefault(row.cell, []).append(row)
    compared = [_compare_cell(cell, rows, now, tolerances) for cell, rows in cells.items()]
    new = dict.fromkeys(row.label for row in after if row.cell not in cells)
    pairs = [(row, now.get((row.cell, row.seed))) for row in before]
    other = dict.fromkeys(old.label for old, new in pairs if new is not None and _differ(old, new))
    return Comparison(tuple(compared), tuple(new), tuple(describe_times(before, now)), tuple(other))


def _compare_cell(
    cell: CellName,
    rows: Sequence[GateRow],
    now: Mapping[tuple[CellName, int], GateRow],
    tolerances: Sequence[Tolerance],
) -> CellComparison:
    pairs = [(row, now.get((cell, row.seed))) for row in rows]
    present = [(old, new) for old, new in pairs if new is not None]
    findings = [_lost(old, new) for old, new in pairs if old.status == _OK and (new is None or new.status != _OK)]
    both_ok = [(old, new) for old, new in present if old.status == _OK and new.status == _OK]
    comparable = [(old, new) for old, new in both_ok if not old.scores.get("num_wrong") and not _differ(old, new)]
    for tolerance in tolerances:
        judged = comparable if tolerance.fine else both_ok
        each = [_judge_seed(old, new, tolerance) for old, new in judged] if tolerance.each_seed else []
        findings += [finding for finding in each if finding] or _judge_all(judged, tolerance)
    dead = all(row.status != _OK for row in rows)
    return CellComparison(cell, len(present), tuple(findings), rows[0].reason or rows[0].status if dead else None)


def _differ(old: GateRow, new: GateRow) -> bool:
    """Whether the data differ: their objective under the true motions, by more than rounding."""
    if not {FINGERPRINT} <= old.scores.keys() & new.scores.keys():
        return False
    return not math.isclose(old.scores[FINGERPRINT], new.scores[FINGERPRINT], rel_tol=_SAME_DATA)


def _lost(old: GateRow, new: GateRow | None) -> Finding:
    now = "missing" if new is None else f"{new.status}: {new.reason or 'no reason given'}"
    return Finding(old.cell, f"seed {old.seed}", "status", old.status, now, "0")


def _judge_seed(old: GateRow, new: GateRow, tolerance: Tolerance) -> Finding | None:
    name = tolerance.score
    if name not in old.scores:
        return None
    before, allowed = old.scores[name], tolerance.allowed(old.scores[name])
    if name not in new.scores:
        fewer_wrong = new.scores.get("num_wrong", math.inf) < old.scores.get("num_wrong", 0.0)
        return None if fewer_wrong else _finding((old.cell, f"seed {old.seed}"), tolerance, before, None, allowed)
    after = new.scores[name]
    if tolerance.worsening(before, after) <= allowed + _ROUNDING:
        return None
    return _finding((old.cell, f"seed {old.seed}"), tolerance, before, after, allowed)


def _judge_all(pairs: Sequence[tuple[GateRow, GateRow]], tolerance: Tolerance) -> list[Finding]:
    """The mean over two seeds or more, or of a score that is not judged by seeds the median over any."""
    known = _known(pairs, tolerance.score)
    if len(known) < 1 + tolerance.each_seed:
        return []
    middle = statistics.fmean if tolerance.each_seed else statistics.median
    before, after = (middle(values) for values in zip(*known, strict=True))
    allowed = tolerance.allowed(before)
    if tolerance.each_seed:
        allowed = statistics.fmean(tolerance.allowed(old) for old, _ in known) / math.sqrt(len(known))
    if tolerance.worsening(before, after) <= allowed + _ROUNDING:
        return []
    seeds = f"{'mean' if tolerance.each_seed else 'median'} of {len(known)} seeds"
    where = (pairs[0][0].cell, seeds if len(known) > 1 else f"seed {pairs[0][0].seed}")
    return [_finding(where, tolerance, before, after, allowed)]


def _known(pairs: Sequence[tuple[GateRow, GateRow]], score: str) -> list[tuple[float, float]]:
    return [(a.scores[score], b.scores[score]) for a, b in pairs if score in a.scores and score in b.scores]


def _finding(
    where: tuple[CellName, str], tolerance: Tolerance, before: float, after: float | None, allowed: float
) -> Finding:
    now = "unknown" if after is None else f"{after:.4g}"
    return Finding(*where, tolerance.score, f"{before:.4g}", now, f"{allowed:.3g}")
