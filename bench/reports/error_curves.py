"""Curves over many runs: errors as distributions, recall of pairs by overlap, reliability of confidences."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from bench.reports import drawing
from bench.reports.drawing import Label, Picture
from bench.reports.svg import Svg
from bench.reports.tables import Results
from bench.scoring import calibration
from bench.scoring.metrics import WRONG_ABOVE_DEG, WRONG_ABOVE_M
from bench.scoring.statistics import wilson_share

OVERLAP_BINS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""Edges of the bins of true overlap."""


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
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
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
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
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
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
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
