"""Curves over many runs: errors as distributions, recall of pairs by overlap, reliability of confidences."""

import itertools
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from bench.reports import drawing
from bench.reports.drawing import Label, Picture
from bench.reports.svg import Svg
from bench.reports.tables import Results, format_value
from bench.scoring import calibration
from bench.scoring.metrics import WRONG_ABOVE_DEG, WRONG_ABOVE_M
from bench.scoring.statistics import wilson_share

NOTHING_SHARED = "none"
"""The bin of pairs that have nothing in common: a motion between them is false."""
_NO_RECALL = dict.fromkeys(("recall", "recall_low", "recall_high", "recall_initial"), math.nan)
OVERLAP_BINS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""Edges of the bins of true overlap."""
_SHOWN = (1e-4, 1e4)
"""Errors that the logarithmic axis shows; smaller ones, zero among them, and larger ones stand at its ends."""
_METHODS_SIDE_BY_SIDE = 6
"""With more methods the figure that shows their points side by side grows wider."""


def draw_errors(results: Results, folder: Path) -> Picture | None:
    """Distribution of the placed maps' errors for each method: the share of maps within a distance of the truth."""
    maps = results.maps
    if maps.empty or not maps["error_m"].notna().any():
        return None
    steps = _error_steps(maps)
    panels = [
        _draw_steps(steps[steps["score"] == name], bound, f"error, {unit}")
        for name, unit, bound in (("error_m", "m", WRONG_ABOVE_M), ("error_deg", "degrees", WRONG_ABOVE_DEG))
    ]
    alt = (
        "Share of all maps placed within an error, for each method; beyond the dotted line a map is wrong. "
        f"Errors below {_SHOWN[0]:g} or above {_SHOWN[1]:g} are drawn there."
    )
    label = Label("errors", "How far maps are from where they belong", alt)
    return drawing.save_picture(panels, drawing.method_legend(maps["method"]), folder, label, steps)


def _error_steps(maps: pd.DataFrame) -> pd.DataFrame:
    """Each error with the share of all maps within it, by method and score."""
    parts = []
    for method, name in itertools.product(dict.fromkeys(maps["method"]), ("error_m", "error_deg")):
        group = maps[maps["method"] == method]
        errors = np.sort(group[name].dropna().to_numpy(dtype=float))
        share = np.arange(1, len(errors) + 1) / max(len(group), 1)
        parts.append(pd.DataFrame({"method": method, "score": name, "value": errors, "share": share}))
    return pd.concat(parts, ignore_index=True)


def _draw_steps(steps: pd.DataFrame, bound: float, label: str) -> Svg:
    """One error's distribution for each method, the bound of *wrong* dotted."""
    with drawing.style():
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
        axis = figure.subplots()
        for method, hand in drawing.method_hands(steps["method"]).items():
            group = steps[steps["method"] == method]
            (line,) = axis.step(np.clip(group["value"], *_SHOWN), group["share"], where="post", linewidth=2)
            line.set(color=hand.colour, marker=hand.marker, markersize=5, markevery=0.12)
        axis.axvline(bound, linestyle=":", linewidth=1, color="#888888")
        axis.set(xscale="log", ylim=(0, 1.03), xlabel=label, ylabel="share of all maps within it")
        drawing.set_plain_decades(axis)
        axis.grid(visible=True)
    return drawing.render(figure, "errors-" + label.rpartition(" ")[2])


def recall_by_overlap(results: Results) -> pd.DataFrame:
    """Recall of pairs by true overlap for each method, confirmed and initial, and the number of false ones.

    Of maps that have nothing in common, `NOTHING_SHARED`, no motion can be asked for: they have no recall.
    """
    pairs = results.pairs
    bins = {f"{low:g} to {high:g}": (low, high) for low, high in itertools.pairwise(OVERLAP_BINS)}
    if not (pairs["overlap_true"] > 0.0).all():
        bins = {NOTHING_SHARED: (-math.inf, 0.0)} | bins
    rows = []
    for (name, (low, high)), (method, group) in itertools.product(bins.items(), pairs.groupby("method", sort=False)):
        inside = group[(group["overlap_true"] > low) & (group["overlap_true"] <= high)]
        right, reliable = inside["right"].astype(bool), inside["status"] == "reliable"
        asked = 0 if name == NOTHING_SHARED else len(inside)
        share = wilson_share(int((right & reliable).sum()) if asked else 0, asked)
        row = {"recall": share.value, "recall_low": share.low, "recall_high": share.high} if asked else {}
        row |= {"recall_initial": float(right.mean())} if asked else {}
        counts = {"pairs": len(inside), **_NO_RECALL, **row, "false": int((~right & reliable).sum())}
        rows.append({"overlap": name, "method": method, **counts})
    return pd.DataFrame(rows)


def draw_recall(recall: pd.DataFrame, folder: Path) -> Picture:
    """Recall of pairs against their true overlap, with 95 % intervals; hollow: before confirmation."""
    shown = recall[recall["overlap"] != NOTHING_SHARED]
    hands, bins = drawing.method_hands(shown["method"]), list(dict.fromkeys(shown["overlap"]))
    width, height = drawing.CURVE_SIZE_IN
    with drawing.style():
        figure = drawing.new_figure(width * max(1.0, len(hands) / _METHODS_SIDE_BY_SIDE), height)
        axis = figure.subplots()
        for k, (method, hand) in enumerate(hands.items()):
            group = shown[shown["method"] == method]
            x = np.arange(len(group)) + 0.7 * ((k + 0.5) / len(hands) - 0.5)
            y = group["recall"].to_numpy(dtype=float)
            bars = np.abs(group[["recall_low", "recall_high"]].to_numpy(dtype=float).T - y)
            axis.errorbar(x, y, yerr=bars, fmt=hand.marker, color=hand.colour, capsize=3)
            axis.plot(x, group["recall_initial"], hand.marker, color=hand.colour, fillstyle="none", markersize=10)
        axis.set_xticks(np.arange(len(bins)), bins)
        axis.set(xlabel="true overlap of the pair", ylabel="pairs with a right motion")
        axis.set(xlim=(-0.5, len(bins) - 0.5), ylim=(-0.03, 1.03))
        axis.grid(visible=True, axis="y")
    alt = "Pairs with a right motion, by true overlap and method, with 95 % intervals; hollow: before confirmation."
    label = Label("recall", "Which pairs are found", alt)
    panels = [drawing.render(figure, "recall")]
    return drawing.save_picture(panels, drawing.method_legend(recall["method"]), folder, label, recall)


def reliability_curve(results: Results) -> pd.DataFrame:
    """For each method and bin of stated confidence: what is stated, the share that is right, with Wilson's interval."""
    rows = []
    for method, (confidence, right) in _stated_confidences(results).items():
        curve = calibration.reliability(confidence, right)
        for k in np.flatnonzero(curve.count):
            count = int(curve.count[k])
            share = wilson_share(round(float(curve.observed[k]) * count), count)
            interval = {"observed": share.value, "observed_low": share.low, "observed_high": share.high}
            rows.append({"method": method, "stated": curve.stated[k], **interval, "maps": count})
    return pd.DataFrame(rows)


def draw_reliability(results: Results, folder: Path) -> Picture | None:
    """Stated confidence of placed maps against the share that is right; none where no method states one."""
    curve = reliability_curve(results)
    if curve.empty:
        return None
    with drawing.style():
        figure = drawing.new_figure(*drawing.CURVE_SIZE_IN)
        axis = figure.subplots()
        axis.plot([0, 1], [0, 1], linestyle=":", color="#888888")
        for method, hand in drawing.method_hands(curve["method"]).items():
            group = curve[curve["method"] == method]
            y = group["observed"].to_numpy(dtype=float)
            bars = np.abs(group[["observed_low", "observed_high"]].to_numpy(dtype=float).T - y)
            axis.errorbar(group["stated"], y, yerr=bars, fmt=hand.marker, color=hand.colour, capsize=3)
            for x, share, count in zip(group["stated"], y, group["maps"], strict=True):
                axis.annotate(f"{count}", (x, share), (-5, -4), textcoords="offset points", ha="right", fontsize=9)
        axis.set(xlabel="stated confidence", ylabel="share that is right", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axis.grid(visible=True)
    errors = {name: calibration.calibration_error(*stated) for name, stated in _stated_confidences(results).items()}
    alt = (
        "Stated confidence of placed maps against the share that is right, with 95 % intervals and the number of maps; "
        "on the dotted line confidence is honest. Expected calibration error: "
        f"{', '.join(f'{name} {format_value(error)}' for name, error in errors.items())}."
    )
    label, panels = Label("reliability", "Are confidences honest?", alt), [drawing.render(figure, "reliability")]
    return drawing.save_picture(panels, drawing.method_legend(curve["method"]), folder, label, curve)


def _stated_confidences(results: Results) -> dict[str, tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]]:
    """By method: the confidences that it states of placed maps, and which of them are right."""
    if results.maps.empty:
        return {}
    stated = results.maps[results.maps["confidence"].notna() & results.maps["error_m"].notna()]
    return {
        str(method): (group["confidence"].to_numpy(dtype=np.float64), ~group["wrong"].to_numpy(dtype=np.bool_))
        for method, group in stated.groupby("method", sort=False)
    }
