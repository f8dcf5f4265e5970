"""Curves over many runs: success against a swept value, errors as distributions, recall by overlap, reliability."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from bench import calibration, drawing
from bench.drawing import Label, Picture
from bench.metrics import WRONG_ABOVE_DEG, WRONG_ABOVE_M
from bench.statistics import breaking_point, wilson_share
from bench.svg import Svg
from bench.tables import Results, format_value

LEVELS = (0.9, 0.5)
"""Success rates whose loss is a breaking point."""
OVERLAP_BINS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""Edges of the bins of true overlap."""
_SIZE = (5.4, 3.9)
"""Of a panel, inches."""
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
    """Where each method's success falls below 90 % and 50 %, coming from the easy end; a dash where it does not."""
    rows = []
    for method, group in curve.groupby("method", sort=False):
        row: dict[str, Any] = {"method": method, "swept": key}
        for level in LEVELS:
            values, shares = [float(v) for v in group[key]], [float(s) for s in group["success"]]
            row[f"below {100 * level:.0f} % at"] = breaking_point(values, shares, level, hard_is_high)
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


def _draw_shares(curve: pd.DataFrame, key: str, name: str, title: str) -> Svg:
    """One share of each method against a swept value."""
    methods = [str(m) for m in dict.fromkeys(curve["method"])]
    colours = drawing.method_colours(methods)
    places = np.unique(_positions(curve[key], curve[key]))
    with drawing.style():
        figure = drawing.new_figure(*_SIZE)
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


def draw_errors(results: Results, folder: Path) -> Picture | None:
    """Distribution of the placed maps' errors for each method: the share of maps within a distance of the truth."""
    maps = results.maps
    if maps.empty or not maps["error_m"].notna().any():
        return None
    methods = [str(m) for m in dict.fromkeys(maps["method"])]
    colours = drawing.method_colours(methods)
    steps = _error_steps(maps, methods)
    panels = [
        _draw_steps(steps[steps["score"] == name], methods, bound, f"error, {unit}")
        for name, unit, bound in (("error_m", "m", WRONG_ABOVE_M), ("error_deg", "degrees", WRONG_ABOVE_DEG))
    ]
    alt = "Share of all maps placed within an error, for each method; beyond the dotted line a map is wrong."
    label = Label("errors", "How far maps are from where they belong", alt)
    return drawing.save_picture(panels, [(m, colours[m]) for m in methods], folder, label, steps)


def _error_steps(maps: pd.DataFrame, methods: Sequence[str]) -> pd.DataFrame:
    """Each error with the share of all maps within it, by method and score."""
    parts = []
    for method, name in itertools.product(methods, ("error_m", "error_deg")):
        group = maps[maps["method"] == method]
        errors = np.sort(group[name].dropna().to_numpy(dtype=float))
        share = np.arange(1, len(errors) + 1) / max(len(group), 1)
        parts.append(pd.DataFrame({"method": method, "score": name, "value": errors, "share": share}))
    return pd.concat(parts, ignore_index=True)


def _draw_steps(steps: pd.DataFrame, methods: Sequence[str], bound: float, label: str) -> Svg:
    """One error's distribution for each method, the bound of *wrong* dotted."""
    colours = drawing.method_colours(methods)
    with drawing.style():
        figure = drawing.new_figure(*_SIZE)
        axis = figure.subplots()
        for method in methods:
            group = steps[steps["method"] == method]
            axis.step(
                np.maximum(group["value"], 1e-4), group["share"], where="post", color=colours[method], linewidth=2
            )
        axis.axvline(bound, linestyle=":", linewidth=1, color="#888888")
        axis.set(xscale="log", ylim=(0, 1.03), xlabel=label, ylabel="share of all maps within it")
        axis.grid(visible=True)
    return drawing.render(figure, "errors-" + label.rpartition(" ")[2])


def recall_by_overlap(results: Results) -> pd.DataFrame:
    """Recall of pairs by true overlap for each method, confirmed and initial, and the number of false ones."""
    pairs = results.pairs
    rows = []
    for method, group in pairs.groupby("method", sort=False):
        for low, high in itertools.pairwise(OVERLAP_BINS):
            inside = group[(group["overlap_true"] > low) & (group["overlap_true"] <= high)]
            right = inside["right"].astype(bool)
            kept = right & (inside["status"] == "reliable")
            share = wilson_share(int(kept.sum()), len(inside))
            rows.append(
                {
                    "method": method,
                    "overlap": f"{low:g}-{high:g}",
                    "pairs": len(inside),
                    "recall": share.value,
                    "recall_low": share.low,
                    "recall_high": share.high,
                    "recall_initial": float(right.mean()) if len(inside) else float("nan"),
                    "false": int((~right & (inside["status"] == "reliable")).sum()),
                }
            )
    return pd.DataFrame(rows)


def draw_recall(recall: pd.DataFrame, folder: Path) -> Picture:
    """Recall of pairs against their true overlap, with 95 % intervals; hollow: before confirmation."""
    methods = [str(m) for m in dict.fromkeys(recall["method"])]
    colours = drawing.method_colours(methods)
    with drawing.style():
        figure = drawing.new_figure(*_SIZE)
        axis = figure.subplots()
        for k, method in enumerate(methods):
            group = recall[recall["method"] == method]
            x = np.arange(len(group)) + 0.16 * (k - (len(methods) - 1) / 2)
            y = group["recall"].to_numpy(dtype=float)
            bars = np.abs(group[["recall_low", "recall_high"]].to_numpy(dtype=float).T - y)
            axis.errorbar(x, y, yerr=bars, fmt="o", color=colours[method], capsize=3)
            axis.plot(x, group["recall_initial"], "o", color=colours[method], fillstyle="none", markersize=9)
            axis.set_xticks(np.arange(len(group)), list(group["overlap"]))
        axis.set(xlabel="true overlap of the pair", ylabel="pairs with a right motion", ylim=(-0.03, 1.03))
        axis.grid(visible=True, axis="y")
    alt = "Pairs with a right motion, by true overlap and method, with 95 % intervals; rings: before confirmation."
    label = Label("recall", "Which pairs are found", alt)
    legend = [(m, colours[m]) for m in methods]
    return drawing.save_picture([drawing.render(figure, "recall")], legend, folder, label, recall)


def draw_reliability(results: Results, folder: Path) -> Picture | None:
    """Stated confidence of placed maps against the share that is right; none where no method states one."""
    maps = results.maps
    stated = maps[maps["confidence"].notna() & maps["error_m"].notna()] if not maps.empty else maps
    if stated.empty:
        return None
    methods = [str(m) for m in dict.fromkeys(stated["method"])]
    colours = drawing.method_colours(methods)
    rows = []
    with drawing.style():
        figure = drawing.new_figure(*_SIZE)
        axis = figure.subplots()
        axis.plot([0, 1], [0, 1], linestyle=":", color="#888888")
        for method in methods:
            group = stated[stated["method"] == method]
            right = ~group["wrong"].to_numpy(dtype=bool)
            curve = calibration.reliability(group["confidence"].to_numpy(dtype=float), right)
            axis.scatter(curve.stated, curve.observed, s=20 + 6 * np.sqrt(curve.count), color=colours[method])
            points = zip(curve.stated, curve.observed, curve.count, strict=True)
            rows += [{"method": method, "stated": s, "observed": o, "maps": n} for s, o, n in points]
        axis.set(xlabel="stated confidence", ylabel="share that is right", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axis.grid(visible=True)
    alt = "Stated confidence of placed maps against the share that is right; on the dotted line it is honest."
    label = Label("reliability", "Are confidences honest?", alt)
    legend, panel = [(m, colours[m]) for m in methods], drawing.render(figure, "reliability")
    return drawing.save_picture([panel], legend, folder, label, pd.DataFrame(rows))


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
