"""The paper's figures: matches and motions (6), an unreliable pair (7), coarse and fine (8), rivals (9)."""

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bench import drawing, pair_metrics
from bench.drawing import PAIR_COLOURS, Label, Picture, map_colours
from bench.exhibit import Exhibit
from bench.merged_picture import draw_merge, frame_of
from bench.prediction import PredictedPair
from merger import se2

_PAIR_WORDS = {
    "tree": "in the tree",
    "reliable": "reliable",
    "rejected": "rejected",
}


def draw_pairs(exhibit: Exhibit, folder: Path) -> Picture:
    """Fig. 6: true matches of each pair (a), pairs with a motion (b), tree, reliable and rejected motions (c)."""
    names = [name.removeprefix("map_") for name in exhibit.prediction.names]
    count = len(names)
    inliers, words = np.zeros((count, count)), np.full((count, count), "no_match", dtype=object)
    for pair in exhibit.prediction.pairs:
        for i, j in ((pair.target, pair.source), (pair.source, pair.target)):
            inliers[i, j] = 0.0 if np.isnan(pair.num_inliers) else pair.num_inliers
            words[i, j] = _word(pair)
    with drawing.style():
        figure = drawing.new_figure(10.5, 4.2)
        axes = figure.subplots(1, 3)
        _draw_counts(axes[0], inliers)
        _draw_words(axes[1], np.where(words == "no_match", words, "rejected"))
        _draw_words(axes[2], words)
        _mark_wrong(axes[2], exhibit)
        for axis, title in zip(
            axes, ("(a) true matches", "(b) pairs with a motion", "(c) confirmed motions"), strict=True
        ):
            axis.set_title(title)
            axis.set_xticks(range(count), names)
            axis.set_yticks(range(count), names)
            axis.tick_params(length=0, labelsize=8)
            axis.set_xlabel("map")
            axis.set_ylabel("map")
        handles = [Patch(color=PAIR_COLOURS[key], label=text) for key, text in _PAIR_WORDS.items()]
        cross = Line2D([], [], linestyle="", marker="x", color=axes[2].title.get_color(), label="wrong, by the truth")
        figure.legend(handles=[*handles, cross], loc="outside lower right", ncols=4, fontsize=9)
    num_motions = sum(p.T_target_source is not None for p in exhibit.prediction.pairs)
    alt = (
        f"Three matrices of the {count} maps of {exhibit.label}: matches that agree, the {num_motions} pairs with a "
        f"motion, and which of these are in the tree, confirmed or rejected."
    )
    title = f"{exhibit.label}, {exhibit.method}: from matches to confirmed motions (Fig. 6)"
    return drawing.save_picture(figure, folder, Label(_name("fig6", exhibit), title, alt), _pair_table(exhibit))


def draw_coarse_fine(exhibit: Exhibit, folder: Path) -> Picture:
    """Fig. 8: the merged map by coarse and by fine motions, beside the truth."""
    truth = exhibit.dataset.truth.T_world_map
    score = exhibit.scored.score
    panels = [
        (f"coarse: Obj. {score['objective_initial']:.3g} cells²", exhibit.T_world_map_initial),
        (f"fine: Obj. {score['objective']:.3g} cells²", exhibit.T_world_map),
        (f"truth: Obj. {score['objective_floor']:.3g} cells²", truth),
    ]
    alt = (
        f"Merged map of {exhibit.label} by {exhibit.method}: coarse motions, fine motions, and the truth. "
        f"{score['num_placed']} of {score['num_maps']} maps placed, {score['num_wrong']} wrong."
    )
    title = f"{exhibit.label}, {exhibit.method}: merged map, coarse and fine (Fig. 8)"
    known = [panel for panel in panels if np.isfinite(panel[1]).any()]
    return _draw_panels(exhibit, known, folder, Label(_name("fig8", exhibit), title, alt))


def draw_rivals(exhibits: Sequence[Exhibit], folder: Path) -> Picture:
    """Fig. 9: what each method makes of one dataset, beside the truth."""
    first = exhibits[0]
    panels = [(_verdict(e), e.T_world_map) for e in exhibits] + [("truth", first.dataset.truth.T_world_map)]
    verdicts = "; ".join(_verdict(e) for e in exhibits)
    title = f"{first.label}: the methods side by side (Fig. 9)"
    alt = f"Merged maps of {first.label} by each method beside the truth. {verdicts}."
    return _draw_panels(first, panels, folder, Label(_name("fig9", first, method=False), title, alt))


def draw_failure(exhibit: Exhibit, folder: Path) -> Picture:
    """What a method made of maps that it placed wrong: the right ones, all of them, and the truth."""
    right = exhibit.T_world_map.copy()
    right[exhibit.errors.wrong] = np.nan
    names = [n for n, wrong in zip(exhibit.prediction.names, exhibit.errors.wrong, strict=True) if wrong]
    truth = exhibit.dataset.truth.T_world_map
    panels = [("all that it placed", exhibit.T_world_map), ("without the wrong maps", right), ("truth", truth)]
    seed = exhibit.scored.cell.seed
    title = f"{exhibit.label}, {exhibit.method}, seed {seed}: {len(names)} wrong of {len(truth)}"
    alt = f"What {exhibit.method} made of {exhibit.label}; wrong are {', '.join(names)}. The right maps, and the truth."
    return _draw_panels(exhibit, panels, folder, Label(_name(f"failure-{seed}", exhibit), title, alt))


def draw_unreliable_pair(exhibit: Exhibit, folder: Path) -> Picture | None:
    """Fig. 7: a rejected pair by its initial and its refined motion, beside the truth; none without one."""
    rejected = [p for p in exhibit.prediction.pairs if p.status == "rejected" and p.T_target_source is not None]
    if not rejected:
        return None
    truth = exhibit.dataset.truth.T_world_map
    pair = max(rejected, key=lambda p: (not pair_metrics.is_right(p, truth), np.nan_to_num(p.num_inliers)))
    return draw_pair(exhibit, pair, folder, "fig7", "an unreliable motion (Fig. 7)")


def draw_pair(exhibit: Exhibit, pair: PredictedPair, folder: Path, stem: str, what: str) -> Picture:
    """Two maps laid together by a pair's initial and refined motion, beside the truth, in the target's true frame."""
    truth = exhibit.dataset.truth.T_world_map
    members, T_world_target = [pair.target, pair.source], truth[pair.target]
    panels = []
    for label, T in (("initial", pair.T_target_source_initial), ("refined", pair.T_target_source)):
        if T is not None:
            poses = np.full_like(truth, np.nan)
            poses[pair.target], poses[pair.source] = T_world_target, T_world_target @ T
            panels.append((label, poses))
    only = np.full_like(truth, np.nan)
    only[members] = truth[members]
    panels.append(("truth", only))
    error_m, error_deg = pair_metrics.pair_errors(pair, truth)
    names = exhibit.prediction.names
    title = f"{exhibit.label}, {exhibit.method}: {what}, {names[pair.target]} and {names[pair.source]}"
    off = f"off by {error_m:.2f} m and {error_deg:.1f} degrees"
    alt = f"Two maps laid together by the motion that was found, {off}, and by the true one."
    return _draw_panels(exhibit, panels, folder, Label(_name(stem, exhibit), title, alt))


def _draw_panels(
    exhibit: Exhibit,
    panels: Sequence[tuple[str, npt.NDArray[np.float64]]],
    folder: Path,
    label: Label,
) -> Picture:
    maps = exhibit.dataset.maps
    shown = np.flatnonzero(np.isfinite(panels[-1][1]).all(axis=(1, 2)))
    poses = panels[-1][1][shown]
    if len(shown) == 2:  # a pair is shown whole, wherever it was laid
        poses = np.concatenate([T[shown] for _, T in panels if np.isfinite(T[shown]).all()])
    raster = frame_of([maps[k] for k in shown] * (len(poses) // len(shown)), poses)
    with drawing.style():
        aspect = raster.rows / raster.cols
        width = 3.5 * len(panels)
        figure = drawing.new_figure(width, 3.5 * min(max(aspect, 0.25), 1.6) + 0.4 + 0.25 * math.ceil(len(shown) / 12))
        for axis, (text, poses) in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
            axis.imshow(draw_merge(maps, poses, raster), interpolation="nearest")
            axis.set_title(text)
            axis.set_axis_off()
        _add_scale(figure.axes[0], raster.cell_m)
        handles = [Patch(color=map_colours(len(maps))[k], label=maps[k].name) for k in shown]
        figure.legend(handles=handles, loc="outside lower center", ncols=12, fontsize=8, handlelength=1.0)
    rows = [
        {"panel": text, "map": m.name, **dict(zip(("x_m", "y_m", "theta_rad"), se2.parameters_of(T), strict=True))}
        for text, poses in panels
        for m, T in zip(maps, poses, strict=True)
    ]
    return drawing.save_picture(figure, folder, label, pd.DataFrame(rows))


def _add_scale(axis: Axes, cell_m: float) -> None:
    """A bar of 5 m in the lower left corner of an image whose pixels have this side."""
    bottom = axis.get_ylim()[0]
    axis.plot([0.0, 5.0 / cell_m], [bottom, bottom], linewidth=2.0, color=axis.title.get_color(), clip_on=False)
    axis.text(5.6 / cell_m, bottom, "5 m", va="center", fontsize=8)


def _draw_counts(axis: Axes, counts: npt.NDArray[np.float64]) -> None:
    shown = np.ma.masked_where(counts <= 0, counts)
    axis.imshow(shown, cmap="Blues", vmin=-0.35 * max(float(counts.max()), 1.0), vmax=max(float(counts.max()), 1.0))
    for i, j in zip(*np.nonzero(counts > 0), strict=True):
        dark = counts[i, j] > 0.45 * counts.max()
        axis.text(
            j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=7, color="white" if dark else "#12283f"
        )


def _draw_words(axis: Axes, words: npt.NDArray[np.object_]) -> None:
    image = np.array([[to_rgba(PAIR_COLOURS[word]) for word in row] for row in words])
    axis.imshow(image)
    axis.set_xticks(np.arange(-0.5, len(words)), minor=True)
    axis.set_yticks(np.arange(-0.5, len(words)), minor=True)
    axis.grid(which="minor", linewidth=0.5)
    axis.tick_params(which="minor", length=0)


def _mark_wrong(axis: Axes, exhibit: Exhibit) -> None:
    """A cross on every motion that truth contradicts."""
    truth = exhibit.dataset.truth.T_world_map
    for pair in exhibit.prediction.pairs:
        if pair.T_target_source is not None and not pair_metrics.is_right(pair, truth):
            for i, j in ((pair.target, pair.source), (pair.source, pair.target)):
                axis.text(j, i, "x", ha="center", va="center", fontsize=9)


def _word(pair: PredictedPair) -> str:
    if pair.T_target_source is None:
        return "no_match"
    return "tree" if pair.in_tree and pair.status == "reliable" else pair.status


def _pair_table(exhibit: Exhibit) -> pd.DataFrame:
    return pd.DataFrame(exhibit.scored.pairs)


def _verdict(exhibit: Exhibit) -> str:
    score = exhibit.scored.score
    return f"{exhibit.method}: {score['num_placed']} of {score['num_maps']} placed, {score['num_wrong']} wrong"


def _name(stem: str, exhibit: Exhibit, method: bool = True) -> str:
    """Stem of a figure's files."""
    parts = [stem, exhibit.label, *([exhibit.method] if method else [])]
    return "-".join(re.sub(r"[^\w.=-]+", "_", part) for part in parts)
