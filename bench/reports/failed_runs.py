"""Runs that gave no answer: why, how many, and where to look."""

from collections.abc import Sequence

from bench.reports.report import MAX_ROWS, Section
from bench.reports.tables import Results, write_swept
from bench.stages import ScoredCell

_TEXT = (
    "Each reason with the number of its runs, and the first of them. A run without an answer is no success; none of "
    "its maps is placed. What a method wrote lies in the folder beside the reason, with the end of its stderr. Runs "
    "are tried again with retry_failed=true, and by themselves once the program that the command names has changed."
)
_NOTHING = "nothing was run"


def failed_runs(results: Results, cells: Sequence[ScoredCell]) -> Section:
    """The reasons for which runs gave no answer, the most frequent first; empty where all did.

    Args:
        results: Their scores, one row a cell.
        cells: The same cells.
    """
    folders = [_folder_of(scored) for scored in cells]
    bad = results.scores.assign(folder=folders)[results.scores["status"] != "ok"]
    if bad.empty:
        return Section("Runs without an answer")
    bad = bad.assign(reason=bad["reason"].fillna("no reason is known"))
    first = {name: (name, "first") for name in (*results.swept, "seed", "order", "folder")}
    groups = bad.groupby(["dataset", "method", "status", "reason"], sort=False)
    table = groups.agg(runs=("seed", "size"), **first).reset_index().sort_values("runs", ascending=False, kind="stable")
    if not table["order"].any():
        table = table.drop(columns="order")
    table = write_swept(table.reset_index(drop=True), results.swept)
    return Section("Runs without an answer", _TEXT, table=table, folded=len(table) > MAX_ROWS)


def _folder_of(scored: ScoredCell) -> str:
    """Where a run's files lie, from the folder of results."""
    folder = scored.result.parent
    return "/".join(folder.parts[-3:]) if folder != scored.dataset and folder.is_dir() else _NOTHING
