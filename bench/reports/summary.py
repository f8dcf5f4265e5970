"""The table of methods: a row a group of runs, the best of each group marked, and what it says in a sentence."""

from collections.abc import Sequence

import pandas as pd

from bench.reports.tables import Results, format_value, rows_that_ran, summarize, write_swept

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
_ERRORS = _BEST_LOW[1:]


def summary_table(results: Results, by: Sequence[str]) -> pd.DataFrame:
    """One row a group of runs, its columns with short names (see `bench.reports.tables.summarize`)."""
    table = summarize(results, by)[[*by, *_SHORT]].rename(columns=_SHORT)
    return write_swept(table, results.swept)


def best_cells(table: pd.DataFrame) -> tuple[tuple[int, str], ...]:
    """Cells with the best value among the methods of one dataset; what most of them reach is no distinction."""
    if "method" not in table or table["method"].nunique() < 2:
        return ()
    keys = list(table.columns[: list(table.columns).index("method")])
    groups = [g for _, g in table.groupby(keys, sort=False, dropna=False)] if keys else [table]
    marks = []
    for group in groups:
        for name in (*_BEST_HIGH, *_BEST_LOW):
            values = pd.to_numeric(group[name], errors="coerce") if name in group else pd.Series(dtype=float)
            if name == "wrong" and "placed" in group:  # who places nothing avoids every mistake
                values = values[group["placed"] > 0]
            if name in _ERRORS and "placed" in group:  # who places fewer maps right is not more exact
                right = group["placed"] - group["wrong"]
                values = values[right == right.max()]
            values = values.map(lambda value: float(f"{value:.3g}"))  # what reads the same is no better
            if values.nunique() > 1:
                best = values.index[values == (values.max() if name in _BEST_HIGH else values.min())]
                marks += [(int(index), name) for index in best if len(best) <= max(2, len(group) // 2)]
    return tuple(marks)


def tell_overview(results: Results, drawing_s: float) -> str:
    """How many runs and maps, how many wrong, what the columns mean, and what the bench cost itself."""
    ran = rows_that_ran(results.scores)
    maps, wrong, silent = int(ran["num_maps"].sum()), int(ran["num_wrong"].sum()), int((ran["status"] != "ok").sum())
    missing = len(results.scores) - len(ran)
    return (
        f"Runs: {len(ran)}, with {maps} maps, of which {wrong} are placed wrong: more than 0.5 m or 2° from where they "
        "belong in the frame that fits most of their component. "
        + (f"Runs that gave no answer: {silent}. " if silent else "")
        + (f"Runs that could not begin, and do not count: {missing}. " if missing else "")
        + "Success: every map is placed in one component and none is wrong; low and high are its 95 % interval "
        "(Wilson). Errors, times and memory are medians over the runs that gave an answer. Obj. is in cells²; "
        "its floor is its value under the true motions, where it ranks nothing." + _overhead(results, drawing_s)
    )


def _overhead(results: Results, drawing_s: float) -> str:
    """How much time the bench itself took, in a sentence; empty where no method ran."""
    method_s, bench_s = (float(results.scores[name].sum()) for name in ("runtime_s", "runtime_overhead_s"))
    if not method_s > 0.0:
        return ""
    share = format_value(100.0 * bench_s / method_s)
    return (
        f" Beside the methods' {format_value(method_s)} s the bench took {share} % for itself (datasets not counted), "
        f"and {format_value(drawing_s)} s once, for this report."
    )
