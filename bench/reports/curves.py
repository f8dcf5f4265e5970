"""Curves of a sweep: success, wrong maps, time and memory against the swept value, and where each method breaks."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes

from bench.reports import drawing
from bench.reports.drawing import Label, Picture
from bench.reports.svg import Svg
from bench.reports.tables import Results, format_swept, rows_that_ran
from bench.scoring.statistics import breaking_point, wilson_share

LEVELS = (0.9, 0.5)
"""Success rates whose loss is a breaking point."""
_SHARES = {
    "success": "runs without a fault",
    "right": "maps placed right",
    "wrong": "placed maps that are wrong",
}
_COSTS = {"runtime_s": "time, s", "peak_memory_mb": "peak memory, MiB"}
_MOST_LETTERS = 40
"""Ticks with more letters together are turned."""
_LONGEST_TICK = 24
"""A word with more letters, a command for example, keeps its first and last ones."""
_NEAREST_TICKS = 0.04
"""Distance of two ticks that can both be read, over that of the first and the last."""


def success_curve(results: Results, key: str) -> pd.DataFrame:
    """Shares of each method at each value of a swept key, with Wilson's intervals.

    ``success`` is of the runs, ``right`` (placed, and not wrong) of all maps, ``wrong`` of the placed maps. Where no
    run began (`bench.reports.tables.rows_that_ran`) there is no row.
    """
    scores = rows_that_ran(results.scores)
    order = list(dict.fromkeys(scores["method"]))
    rows: list[dict[str, Any]] = []
    for (method, value), group in _by_method_and_value(scores, key):
        maps, placed, wrong = (int(group[name].sum()) for name in ("num_maps", "num_placed", "num_wrong"))
        counts = {
            "success": (int(group["success"].astype(bool).sum()), len(group)),
            "right": (placed - wrong, maps),
            "wrong": (wrong, placed),
        }
        row: dict[str, Any] = {"method": method, key: value, "runs": len(group)}
        for name, count in counts.items():
            share = wilson_share(*count)
            row |= {name: share.value, f"{name}_low": share.low, f"{name}_high": share.high}
        rows.append(row)
    rows.sort(key=lambda row: order.index(row["method"]))
    return pd.DataFrame(rows)


def breaking_points(curve: pd.DataFrame, key: str, hard_is_high: bool) -> pd.DataFrame:
    """Where each method's success falls below 90 % and 50 %, coming from the easy end.

    In brackets where the lower and where the upper ends of the intervals do, between which it lies; *already* where
    success is below at the easiest value, *nowhere* where it is at none.
    """
    easiest = float(curve[key].min() if hard_is_high else curve[key].max())
    rows = []
    for method, group in curve.groupby("method", sort=False):
        row: dict[str, Any] = {"method": method, "runs a point": _span(group["runs"])}
        for level in LEVELS:
            points = [
                breaking_point(group[key].astype(float).tolist(), group[name].tolist(), level, hard_is_high)
                for name in ("success", "success_low", "success_high")
            ]
            value, low, high = (_tell(point, easiest) for point in points)
            row[f"below {100 * level:.0f} % at"] = value if value == low == high else f"{value} ({low} to {high})"
        rows.append(row)
    return pd.DataFrame(rows)


def draw_success(curve: pd.DataFrame, key: str, folder: Path) -> Picture:
    """Runs without a fault, maps placed right and wrong against a swept value, with 95 % intervals."""
    alt = (
        f"Runs without a fault, maps placed right and placed maps that are wrong against {key}, by method, with 95 % "
        "intervals, those of maps as if no two shared a run; the dotted lines are at 90 % and 50 %."
    )
    label = Label(f"success-{key}", f"Success against {key}", alt)
    panels = [_draw_curve(curve, key, name, title) for name, title in _SHARES.items()]
    return drawing.save_picture(panels, drawing.method_legend(curve["method"]), folder, label, curve)


def draw_costs(results: Results, key: str, folder: Path) -> Picture | None:
    """Time and memory of each method against a swept number: the median and the range; none where nothing ran."""
    known = results.scores[results.scores["status"] == "ok"]
    if known.empty or not is_number(known[key]):
        return None
    columns = {
        f"{score}{suffix}": pd.NamedAgg(score, part)
        for score, (suffix, part) in itertools.product(_COSTS, (("", "median"), ("_low", "min"), ("_high", "max")))
    }
    table = _by_method_and_value(known, key).agg(**columns).reset_index()
    alt = (
        f"Time and peak memory against {key}, by method: medians over the runs that gave an answer, with bars from the "
        "least to the most."
    )
    label = Label(f"costs-{key}", f"Time and memory against {key}", alt)
    panels = [_draw_curve(table, key, name, title) for name, title in _COSTS.items()]
    return drawing.save_picture(panels, drawing.method_legend(table["method"]), folder, label, table)


def _draw_curve(table: pd.DataFrame, key: str, name: str, title: str) -> Svg:
    """A column of each method against a swept value, with bars from its ``_low`` to its ``_high``."""
    hands = drawing.method_hands(table["method"])
    places = np.unique(_positions(table[key], table[key]))
    with drawing.style():
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
        axis = figure.subplots()
        for k, (method, hand) in enumerate(hands.items()):
            group = table[table["method"] == method]
            shift = 0.008 * (k - (len(hands) - 1) / 2) * float(np.ptp(places) or 1.0)
            y, low, high = (group[f"{name}{end}"].to_numpy(dtype=float) for end in ("", "_low", "_high"))
            x, bars = _positions(table[key], group[key]) + shift, np.stack([y - low, high - y])
            axis.errorbar(x, y, yerr=bars, fmt=f"{hand.marker}-", color=hand.colour, capsize=3, linewidth=2)
        axis.set(title=title, xlabel=key)
        axis.grid(visible=True)
        _set_ticks(axis, table[key])
        _set_range(axis, name, float(table[f"{name}_high"].max()))
    return drawing.render(figure, f"{name}-{key}")


def _set_range(axis: Axes, name: str, highest: float) -> None:
    """Shares from 0 to 100 %, success with the levels of its breaking points; costs from 0 to above the highest."""
    if name not in _SHARES:
        axis.set_ylim(0.0, 1.05 * highest if highest > 0.0 else 1.0)
        return
    axis.set_ylim(-0.03, 1.03)
    axis.yaxis.set_major_formatter(lambda value, _position: f"{100 * value:.0f} %")
    for level in LEVELS if name == "success" else ():
        axis.axhline(level, linestyle=":", linewidth=1, color="#888888")


def _set_ticks(axis: Axes, values: "pd.Series[Any]") -> None:
    """A tick for every swept value; many letters are turned, and a tick that its neighbour would hide stays silent."""
    places = np.unique(_positions(values, values))
    ticks = [format_swept(value) for value in sorted(dict.fromkeys(values))] if is_number(values) else _words(values)
    shown, last = [], -math.inf
    for place, tick in zip(places, ticks, strict=True):
        clear = place - last >= _NEAREST_TICKS * float(np.ptp(places))
        shown.append(_shorten(tick) if clear else "")
        last = place if clear else last
    axis.set_xticks(places, shown, rotation=45 if sum(map(len, shown)) > _MOST_LETTERS else 0)
    margin = 0.05 * float(np.ptp(places) or 1.0)
    axis.set_xlim(places[0] - margin, places[-1] + margin)


def _shorten(word: str) -> str:
    half = _LONGEST_TICK // 2
    return word if len(word) <= _LONGEST_TICK else f"{word[:half]}…{word[-half:]}"


def _span(counts: "pd.Series[int]") -> str:
    """A count, or the least and the most of several."""
    return " to ".join(map(str, sorted({int(counts.min()), int(counts.max())})))


def _tell(point: float, easiest: float) -> str:
    """A breaking point in words."""
    if math.isnan(point):
        return "nowhere"
    return f"{point:.3g} already" if point == easiest else f"{point:.3g}"


def is_number(values: "pd.Series[Any]") -> bool:
    """Whether swept values are numbers, that have a place on an axis; not where one is true, false or null."""
    numeric = pd.api.types.is_numeric_dtype(values) and not pd.api.types.is_bool_dtype(values)
    return bool(numeric and values.notna().all())


def _by_method_and_value(scores: pd.DataFrame, key: str) -> Any:
    """Groups of runs: numbers from the least to the most, words as they come."""
    ordered = scores.sort_values(key, kind="stable") if is_number(scores[key]) else scores
    return ordered.groupby(["method", key], sort=False, dropna=False)


def _words(values: "pd.Series[Any]") -> list[str]:
    """The words of a column, each once, in their order."""
    return list(dict.fromkeys(map(format_swept, values)))


def _positions(values: "pd.Series[Any]", of: "pd.Series[Any]") -> npt.NDArray[np.float64]:
    """Where values stand on an axis: numbers at their place, words in their order."""
    if is_number(values):
        return of.to_numpy(dtype=np.float64)
    names = _words(values)
    return np.array([names.index(format_swept(value)) for value in of], dtype=np.float64)
