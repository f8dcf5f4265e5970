"""Curves of a sweep: success against the swept value, and where it breaks."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from bench.reports import drawing
from bench.reports.drawing import Label, Picture
from bench.reports.svg import Svg
from bench.reports.tables import Results, format_value
from bench.scoring.statistics import breaking_point, wilson_share

LEVELS = (0.9, 0.5)
"""Success rates whose loss is a breaking point."""
_MOST_LETTERS = 48
"""Ticks with more letters together are turned."""


def success_curve(results: Results, key: str) -> pd.DataFrame:
    """Success rate and rate of wrong maps for each method at each value of a swept key, with Wilson's intervals."""
    rows = []
    for (method, value), group in results.scores.groupby(["method", key], sort=True, dropna=False):
        success = wilson_share(int(group["success"].astype(bool).sum()), len(group))
        placed = int(group["num_placed"].sum())
        wrong = wilson_share(int(group["num_wrong"].sum()), placed)
        rows.append(
            {
                "method": method,
                key: value,
                "runs": len(group),
                "success": success.value,
                "success_low": success.low,
                "success_high": success.high,
                "placed": placed / max(int(group["num_maps"].sum()), 1),
                "wrong": wrong.value,
                "wrong_low": wrong.low,
                "wrong_high": wrong.high,
            }
        )
    return pd.DataFrame(rows)


def breaking_points(curve: pd.DataFrame, key: str, hard_is_high: bool) -> pd.DataFrame:
    """Where each method's success falls below 90 % and 50 %, coming from the easy end; a dash where it does not.

    In brackets where the lower and where the upper ends of the intervals do, between which it lies.
    """
    rows = []
    for method, group in curve.groupby("method", sort=False):
        row: dict[str, Any] = {"method": method, "swept": key}
        for level in LEVELS:
            points = [
                breaking_point(group[key].astype(float).tolist(), group[name].tolist(), level, hard_is_high)
                for name in ("success", "success_low", "success_high")
            ]
            value, low, high = ("-" if math.isnan(point) else f"{point:.3g}" for point in points)
            row[f"below {100 * level:.0f} % at"] = f"{value} ({low} to {high})"
        rows.append(row)
    return pd.DataFrame(rows)


def draw_success(curve: pd.DataFrame, key: str, folder: Path) -> Picture:
    """Success, and share of placed maps that are wrong, against a swept value, with 95 % intervals."""
    methods = [str(m) for m in dict.fromkeys(curve["method"])]
    colours = drawing.method_colours(methods)
    panels = [
        _draw_shares(curve, key, name, title)
        for name, title in (("success", "runs without a fault"), ("wrong", "placed maps that are wrong"))
    ]
    alt = f"Success of {', '.join(methods)} against {key} and placed maps that are wrong, with 95 % intervals."
    label = Label(f"success-{key}", f"Success against {key}", alt)
    return drawing.save_picture(panels, [(m, colours[m]) for m in methods], folder, label, curve)


def draw_costs(results: Results, key: str, folder: Path) -> Picture | None:
    """Time and memory of each method against a swept number: the median and the range; none where nothing ran."""
    known = results.scores[results.scores["status"] == "ok"]
    if known.empty or not _numeric(known[key]):
        return None
    columns = {
        f"{score}_{part}": pd.NamedAgg(score, part)
        for score, part in itertools.product(("runtime_s", "peak_memory_mb"), ("median", "min", "max"))
    }
    table = known.groupby(["method", key], sort=True).agg(**columns).reset_index()
    methods = [str(m) for m in dict.fromkeys(table["method"])]
    colours = drawing.method_colours(methods)
    panels = [
        _draw_range(table, key, score, title)
        for score, title in (("runtime_s", "time, s"), ("peak_memory_mb", "peak memory, MiB"))
    ]
    alt = f"Time and peak memory of {', '.join(methods)} against {key}: medians, with bars from the least to the most."
    label = Label(f"costs-{key}", f"Time and memory against {key}", alt)
    return drawing.save_picture(panels, [(m, colours[m]) for m in methods], folder, label, table)


def _draw_range(table: pd.DataFrame, key: str, score: str, title: str) -> Svg:
    """The median and the range of a score of each method against a swept number."""
    colours = drawing.method_colours([str(m) for m in dict.fromkeys(table["method"])])
    with drawing.style():
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
        axis = figure.subplots()
        for method, group in table.groupby("method", sort=False):
            x, middle = group[key].to_numpy(dtype=float), group[f"{score}_median"].to_numpy(dtype=float)
            low, high = (group[f"{score}_{end}"].to_numpy(dtype=float) for end in ("min", "max"))
            bars = np.stack([middle - low, high - middle])
            axis.errorbar(x, middle, yerr=bars, fmt="o-", color=colours[str(method)], capsize=3, linewidth=2)
        axis.set(title=title, xlabel=key)
        axis.set_ylim(bottom=0.0)
        axis.grid(visible=True)
    return drawing.render(figure, f"{score}-{key}")


def _draw_shares(curve: pd.DataFrame, key: str, name: str, title: str) -> Svg:
    """One share of each method against a swept value."""
    methods = [str(m) for m in dict.fromkeys(curve["method"])]
    colours = drawing.method_colours(methods)
    places = np.unique(_positions(curve[key], curve[key]))
    with drawing.style():
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
        axis = figure.subplots()
        for method in methods:
            group = curve[curve["method"] == method]
            x, y = _positions(curve[key], group[key]), group[name].to_numpy(dtype=float)
            low, high = group[f"{name}_low"].to_numpy(dtype=float), group[f"{name}_high"].to_numpy(dtype=float)
            x = x + 0.008 * (methods.index(method) - (len(methods) - 1) / 2) * float(np.ptp(places) or 1.0)
            axis.errorbar(x, y, yerr=np.stack([y - low, high - y]), fmt="none", ecolor=colours[method], capsize=3)
            axis.plot(x, y, "o-", color=colours[method], linewidth=2)
        axis.set(title=title, xlabel=key, ylim=(-0.03, 1.03))
        axis.yaxis.set_major_formatter(lambda value, _position: f"{100 * value:.0f} %")
        axis.grid(visible=True)
        ticks = (
            [_tick(value) for value in sorted(dict.fromkeys(curve[key]))]
            if _numeric(curve[key])
            else _words(curve[key])
        )
        axis.set_xticks(places, ticks, rotation=45 if sum(map(len, ticks)) > _MOST_LETTERS else 0)
        if name == "success":
            for level in LEVELS:
                axis.axhline(level, linestyle=":", linewidth=1, color="#888888")
    return drawing.render(figure, f"{name}-{key}")


def _tick(value: object) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) else format_value(value)


def _numeric(values: "pd.Series[Any]") -> bool:
    return bool(pd.api.types.is_numeric_dtype(values))


def _words(values: "pd.Series[Any]") -> list[str]:
    """The words of a column, each once, in their order."""
    return list(dict.fromkeys(values.astype(str)))


def _positions(values: "pd.Series[Any]", of: "pd.Series[Any]") -> npt.NDArray[np.float64]:
    """Where values stand on an axis: numbers at their place, words in their order."""
    if _numeric(values):
        return of.to_numpy(dtype=np.float64)
    names = _words(values)
    return np.array([names.index(name) for name in of.astype(str)], dtype=np.float64)
