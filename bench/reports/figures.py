"""The paper's figures: matches and motions (6), an unreliable pair (7), coarse and fine (8), rivals (9)."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.colors import to_hex

from bench.cell import hash_of
from bench.reports import drawing
from bench.reports.drawing import PAIR_COLOURS, Label, Picture, map_colours
from bench.reports.exhibit import Exhibit
from bench.reports.merged_picture import draw_merge, frame_of
from bench.reports.panels import draw_image, draw_matrix
from bench.reports.svg import Entry
from bench.reports.tables import format_value
from bench.scoring import pair_metrics
from bench.scoring.prediction import PredictedPair
from merger import se2
from merger.grid_map import GridMap

_MOST_WIDENED = 4.0
"""How much coarser than the truth a picture may get, to show two maps that lie apart."""
_LONGEST_NAME = 150
"""Letters of a file's name."""
_PAIR_WORDS = {
    "tree": "in the tree",
    "reliable": "reliable",
    "rejected": "rejected",
}


def draw_pairs(exhibit: Exhibit, folder: Path) -> Picture:
    """Fig. 6: matches of each pair, where the method tells of any, pairs with a motion, and what became of them."""
    names = [name.removeprefix("map_") for name in exhibit.prediction.names]
    count = len(names)
    inliers, words = np.zeros((count, count)), np.full((count, count), "no_match", dtype=object)
    for pair in exhibit.prediction.pairs:
        for i, j in ((pair.target, pair.source), (pair.source, pair.target)):
            inliers[i, j] = 0.0 if np.isnan(pair.num_inliers) else pair.num_inliers
            words[i, j] = _word(pair)
    truth = exhibit.dataset.truth.T_world_map
    wrong = np.full((count, count), "", dtype=object)
    for pair in exhibit.prediction.pairs:
        if pair.T_target_source is not None and not pair_metrics.is_right(pair, truth):
            wrong[pair.target, pair.source] = wrong[pair.source, pair.target] = "✕"
    nothing, found = np.full((count, count), "", dtype=object), _shade((words != "no_match").astype(float) / 2.0)
    counts = np.where(inliers > 0, np.char.mod("%d", inliers), "").astype(object)
    panels = [
        draw_matrix("matches that agree", names, _shade(inliers), counts),
        draw_matrix("pairs with a motion", names, found, nothing),
        draw_matrix("confirmed motions", names, _colour(words), wrong),
    ][0 if inliers.any() else 1 :]
    legend = [Entry(text, PAIR_COLOURS[key]) for key, text in _PAIR_WORDS.items()]
    num_motions = sum(p.T_target_source is not None for p in exhibit.prediction.pairs)
    alt = (
        f"The {count} maps of {exhibit.label} against each other: {'matches that agree, ' * bool(inliers.any())}the "
        f"{num_motions} pairs with a motion, and which of these are in the tree, confirmed or rejected; a cross: the "
        "truth contradicts it."
    )
    title = f"{exhibit.label}, {exhibit.method}: from matches to confirmed motions"
    label = Label(_name("fig6", exhibit), title, alt)
    return drawing.save_picture(panels, legend, folder, label, pd.DataFrame(exhibit.scored.pairs))


def draw_coarse_fine(exhibit: Exhibit, folder: Path) -> Picture:
    """Fig. 8: the merged map by coarse and by fine motions, beside the truth."""
    truth = exhibit.dataset.truth.T_world_map
    score = exhibit.scored.score
    panels = [
        (f"coarse: Obj. {format_value(score['objective_initial'])} cells²", exhibit.T_world_map_initial),
        (f"fine: Obj. {format_value(score['objective'])} cells²", exhibit.T_world_map),
        (f"truth: Obj. {format_value(score['objective_floor'])} cells²", truth),
    ]
    alt = (
        f"Merged map of {exhibit.label} by {exhibit.method}: coarse motions, fine motions, and the truth. "
        f"{score['num_placed']} of {score['num_maps']} maps placed, {score['num_wrong']} wrong."
    )
    title = f"{exhibit.label}, {_verdict(exhibit)}"
    known = [panel for panel in panels if np.isfinite(panel[1]).any()]
    return _draw_panels(exhibit.dataset.maps, known, folder, Label(_name("fig8", exhibit), title, alt))


def draw_rivals(exhibits: Sequence[Exhibit], folder: Path) -> Picture:
    """Fig. 9: what each method makes of one dataset, beside the truth."""
    first = exhibits[0]
    panels = [(_verdict(e), e.T_world_map) for e in exhibits] + [("truth", first.dataset.truth.T_world_map)]
    verdicts = "; ".join(_verdict(e) for e in exhibits)
    title = f"{first.label}: the methods side by side"
    alt = f"Merged maps of {first.label} by each method beside the truth. {verdicts}."
    return _draw_panels(first.dataset.maps, panels, folder, Label(_name("fig9", first, method=False), title, alt))


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
    return _draw_panels(exhibit.dataset.maps, panels, folder, Label(_name(f"failure-{seed}", exhibit), title, alt))


def draw_unreliable_pair(exhibit: Exhibit, folder: Path) -> Picture | None:
    """Fig. 7: a rejected pair by its initial and its refined motion, beside the truth; none without one."""
    rejected = [p for p in exhibit.prediction.pairs if p.status == "rejected" and p.T_target_source is not None]
    if not rejected:
        return None
    truth = exhibit.dataset.truth.T_world_map
    pair = max(rejected, key=lambda p: (not pair_metrics.is_right(p, truth), np.nan_to_num(p.num_inliers)))
    return draw_pair(exhibit, pair, folder, "fig7", "an unreliable motion")


def draw_pair(exhibit: Exhibit, pair: PredictedPair, folder: Path, stem: str, what: str) -> Picture:
    """Two maps laid together by a pair's initial and refined motion, beside the truth, in the target's true frame."""
    truth = exhibit.dataset.truth.T_world_map
    motions = {"initial": pair.T_target_source_initial, "refined": pair.T_target_source}
    T_world_target = truth[pair.target]
    panels = [(text, np.stack([T_world_target, T_world_target @ T])) for text, T in motions.items() if T is not None]
    panels.append(("truth", truth[[pair.target, pair.source]]))
    error_m, error_deg = pair_metrics.pair_errors(pair, truth)
    names = exhibit.prediction.names
    title = f"{exhibit.label}, {exhibit.method}: {what}, {names[pair.target]} and {names[pair.source]}"
    off = f"off by {format_value(error_m)} m and {format_value(error_deg)} degrees"
    alt = f"Two maps laid together by the motion that was found, {off}, and by the true one."
    maps = [exhibit.dataset.maps[pair.target], exhibit.dataset.maps[pair.source]]
    return _draw_panels(maps, panels, folder, Label(_name(stem, exhibit), title, alt))


def _draw_panels(
    maps: Sequence[GridMap], panels: Sequence[tuple[str, npt.NDArray[np.float64]]], folder: Path, label: Label
) -> Picture:
    """Maps at each panel's poses, in the frame of the last, the truth; two maps are shown whole unless far apart."""
    raster = frame_of(maps, panels[-1][1])
    if len(maps) == 2:
        poses = np.concatenate([T for _, T in panels])
        known = [int(k) for k in np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))]
        whole = frame_of([maps[k % 2] for k in known], poses[known])
        raster = whole if whole.cell_m <= _MOST_WIDENED * raster.cell_m else raster
    merges = [draw_merge(maps, T, raster) for _, T in panels]
    titles = [
        f"{text} ({merge.num_outside} outside)" if merge.num_outside else text
        for (text, _), merge in zip(panels, merges, strict=True)
    ]
    images = [draw_image(title, m.image, raster.cell_m) for title, m in zip(titles, merges, strict=True)]
    colours = map_colours(len(maps))
    legend = [Entry(grid.name, to_hex(colour)) for grid, colour in zip(maps, colours, strict=True)]
    rows = [
        {"panel": text, "map": m.name, **dict(zip(("x_m", "y_m", "theta_rad"), se2.parameters_of(T), strict=True))}
        for text, poses in panels
        for m, T in zip(maps, poses, strict=True)
    ]
    return drawing.save_picture(images, legend, folder, label, pd.DataFrame(rows))


def _shade(counts: npt.NDArray[np.float64]) -> npt.NDArray[np.object_]:
    """The more, the darker; empty cells for nothing."""
    share = counts / max(float(counts.max(initial=0.0)), 1.0)
    shades = [to_hex((0.82 - 0.6 * s, 0.9 - 0.4 * s, 0.98 - 0.1 * s)) if s > 0 else "none" for s in share.reshape(-1)]
    return np.array(shades, dtype=object).reshape(counts.shape)


def _colour(words: npt.NDArray[np.object_]) -> npt.NDArray[np.object_]:
    return np.array([[PAIR_COLOURS[word] for word in row] for row in words], dtype=object)


def _word(pair: PredictedPair) -> str:
    if pair.T_target_source is None:
        return "no_match"
    return "tree" if pair.in_tree and pair.status == "reliable" else pair.status


def _verdict(exhibit: Exhibit) -> str:
    score, p = exhibit.scored.score, exhibit.prediction
    pieces = len(np.unique(p.component[p.placed]))
    apart = f" in {pieces} pieces" if pieces > 1 else ""
    return f"{exhibit.method}: {score['num_placed']} of {score['num_maps']} placed{apart}, {score['num_wrong']} wrong"


def _name(stem: str, exhibit: Exhibit, method: bool = True) -> str:
    """Stem of a figure's files: that of no other, whatever letters its names are made of."""
    cell = exhibit.scored.cell
    parts = [stem, exhibit.label.replace(", ", "_"), *([exhibit.method] if method else [])]
    parts += [f"order_{cell.order}"] if cell.order > 1 else []
    name = "-".join(parts)
    plain = re.sub(r"[^\w.=-]+", "_", name, flags=re.ASCII)[:_LONGEST_NAME]
    return plain if plain == name else f"{plain}-{hash_of(name)[:6]}"
