"""Curves over many runs: success against a swept value, errors as distributions, recall by overlap, reliability."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from bench import calibration, drawing
from bench.drawing import Label, Picture
from bench.statistics import breaking_point, wilson_share
from bench.tables import Results, format_value

LEVELS = (0.9, 0.5)
"""Success rates whose loss is a breaking point."""
OVERLAP_BINS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""Edges of the bins of true overlap."""


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
    places = np.unique(_positions(curve[key], curve[key]))
    with drawing.style():
        figure = drawing.new_figure(10.5, 4.2)
        left, right = figure.subplots(1, 2)
        for axis, name, title in (
            (left, "success", "runs without a fault"),
            (right, "wrong", "placed maps that are wrong"),
        ):
            for method in methods:
                group = curve[curve["method"] == method]
                x, y = _positions(curve[key], group[key]), group[name].to_numpy(dtype=float)
                low, high = group[f"{name}_low"].to_numpy(dtype=float), group[f"{name}_high"].to_numpy(dtype=float)
                x = x + 0.008 * (methods.index(method) - (len(methods) - 1) / 2) * float(np.ptp(places) or 1.0)
                axis.errorbar(x, y, yerr=np.stack([y - low, high - y]), fmt="none", ecolor=colours[method], capsize=3)
                axis.plot(x, y, "o-", color=colours[method], label=method, linewidth=2)
            axis.set(title=title, xlabel=key, ylim=(-0.03, 1.03))
            axis.yaxis.set_major_formatter(lambda value, _position: f"{100 * value:.0f} %")
            axis.grid(visible=True)
            axis.set_xticks(places, [_tick(value) for value in dict.fromkeys(curve[key])])
        for level in LEVELS:
            left.axhline(level, linestyle=":", linewidth=1, color="#888888")
        figure.legend(*left.get_legend_handles_labels(), loc="outside upper left", ncols=len(methods))
    alt = f"Success of {', '.join(methods)} against {key} and placed maps that are wrong, with 95 % intervals."
    return drawing.save_picture(figure, folder, Label(f"success-{key}", f"Success against {key}", alt), curve)


def draw_errors(results: Results, folder: Path) -> Picture | None:
    """Distribution of the placed maps' errors for each method: the share of maps within a distance of the truth."""
    maps = results.maps
    if maps.empty or not maps["error_m"].notna().any():
        return None
    methods = [str(m) for m in dict.fromkeys(maps["method"])]
    colours = drawing.method_colours(methods)
    rows = []
    with drawing.style():
        figure = drawing.new_figure(10.5, 3.9)
        for axis, name, unit in zip(figure.subplots(1, 2), ("error_m", "error_deg"), ("m", "degrees"), strict=True):
            for method in methods:
                group = maps[maps["method"] == method]
                errors = np.sort(group[name].dropna().to_numpy(dtype=float))
                share = np.arange(1, len(errors) + 1) / max(len(group), 1)
                axis.step(
                    np.maximum(errors, 1e-4), share, where="post", color=colours[method], label=method, linewidth=2
                )
                rows += [
                    {"method": method, "score": name, "value": e, "share": s}
                    for e, s in zip(errors, share, strict=True)
                ]
            axis.axvline(0.5 if unit == "m" else 2.0, linestyle=":", linewidth=1, color="#888888")
            axis.set(xscale="log", ylim=(0, 1.03), xlabel=f"error, {unit}", ylabel="share of all maps within it")
            axis.grid(visible=True)
        figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=len(methods))
    alt = "Share of all maps placed within an error, for each method; beyond the dotted line a map is wrong."
    return drawing.save_picture(
        figure, folder, Label("errors", "How far maps are from where they belong", alt), pd.DataFrame(rows)
    )


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
        figure = drawing.new_figure(8.5, 4.0)
        axis = figure.subplots()
        for k, method in enumerate(methods):
            group = recall[recall["method"] == method]
            x = np.arange(len(group)) + 0.16 * (k - (len(methods) - 1) / 2)
            y = group["recall"].to_numpy(dtype=float)
            bars = np.abs(group[["recall_low", "recall_high"]].to_numpy(dtype=float).T - y)
            axis.errorbar(x, y, yerr=bars, fmt="o", color=colours[method], capsize=3, label=method)
            axis.plot(x, group["recall_initial"], "o", color=colours[method], fillstyle="none", markersize=9)
            axis.set_xticks(np.arange(len(group)), list(group["overlap"]))
        axis.set(xlabel="true overlap of the pair", ylabel="pairs with a right motion", ylim=(-0.03, 1.03))
        axis.grid(visible=True, axis="y")
        figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=len(methods))
    alt = "Pairs with a right motion, by true overlap and method, with 95 % intervals; rings: before confirmation."
    return drawing.save_picture(figure, folder, Label("recall", "Which pairs are found", alt), recall)


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
        figure = drawing.new_figure(5.4, 4.6)
        axis = figure.subplots()
        axis.plot([0, 1], [0, 1], linestyle=":", color="#888888")
        for method in methods:
            group = stated[stated["method"] == method]
            curve = calibration.reliability(
                group["confidence"].to_numpy(dtype=float), ~group["wrong"].to_numpy(dtype=bool)
            )
            axis.scatter(
                curve.stated, curve.observed, s=20 + 6 * np.sqrt(curve.count), color=colours[method], label=method
            )
            rows += [
                {"method": method, "stated": s, "observed": o, "maps": n}
                for s, o, n in zip(curve.stated, curve.observed, curve.count, strict=True)
            ]
        axis.set(xlabel="stated confidence", ylabel="share that is right", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axis.grid(visible=True)
        axis.legend()
    alt = "Stated confidence of placed maps against the share that is right; on the dotted line it is honest."
    return drawing.save_picture(
        figure, folder, Label("reliability", "Are confidences honest?", alt), pd.DataFrame(rows)
    )


def _tick(value: object) -> str:
    return f"{value:g}" if isinstance(value, (int, float)) else format_value(value)


def _positions(values: "pd.Series[Any]", of: "pd.Series[Any]") -> npt.NDArray[np.float64]:
    """Where values stand on an axis: numbers at their place, words in their order."""
    if pd.api.types.is_numeric_dtype(values):
        return of.to_numpy(dtype=np.float64)
    names = list(dict.fromkeys(values.astype(str)))
    return np.array([names.index(name) for name in of.astype(str)], dtype=np.float64)
