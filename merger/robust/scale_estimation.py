"""Maps whose stated resolution is off by a few per cent: their scales, from how the walls of pairs agree.

Each pair is searched under several scales of its source; the best is refined until the walls agree most tightly. The
logarithms of the pairs' scales are then averaged over the graph of sure pairs, relative to the reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.robust.dense_search import search_motions
from merger.robust.forks import map_in_forks
from merger.robust.hypotheses import Hypothesis, find_hypotheses
from merger.robust.stages import DescribedMap, describe_maps
from merger.robust.verification import measure_evidence
from merger.robust.wall_alignment import align_walls
from merger.robust.wall_structure import extract_structure

Array = npt.NDArray[np.float64]

_COARSE_SCALES = tuple(1.0 + 0.025 * k for k in range(-4, 5))
"""Scales of a source relative to its target: two maps that are each off by 5 % differ by 10 %."""
_FINE_STEPS = (0.008, 0.003, 0.001)
"""Steps of the refinement of a scale, tried up and down."""
_SURE_LOG_ODDS = 2.5
"""Pairs at least so probable say something about scales; a median of many tells the few wrong ones apart."""


@dataclass(frozen=True)
class _PairScale:
    """What one pair says about the scale of its source relative to its target."""

    log_scale: float
    log_odds: float
    """Log-odds of its motion under this scale."""


def estimate_scales(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> Array:
    """Estimate the scale of every map relative to the reference.

    Args:
        maps: The N maps in canonical order.
        config: The settings; ``reference`` names one of the maps.
        progress: Told of sources that are done.

    Returns:
        (N,) factors by which the maps' metres must be multiplied: 1 for the reference, and for maps that no sure
        pair joins to it.
    """
    described = describe_maps(maps, config, progress)
    scaled = [describe_maps([scale_map(grid, s) for grid in maps], config, _quiet) for s in _COARSE_SCALES]

    def work(j: int) -> list[_PairScale]:
        found = [_search(described[:j], row[j], config) for row in scaled]
        return [_best_scale(described[i], maps[j], [motions[i] for motions in found], config) for i in range(j)]

    sources = range(len(maps) - 1, 0, -1)
    rows = map_in_forks(work, sources, config.workers, "scales", progress)
    pairs = {(i, j): item for j, row in zip(sources, rows, strict=True) for i, item in enumerate(row)}
    root = next((k for k, grid in enumerate(maps) if grid.name == config.reference), 0)
    return _average(pairs, len(maps), root, _SURE_LOG_ODDS)


def scale_map(grid: GridMap, scale: float) -> GridMap:
    """Multiply a map's metres, those of its origin included."""
    T_map_grid = grid.T_map_grid.copy()
    T_map_grid[:2, 2] *= scale
    return replace(grid, resolution_m=grid.resolution_m * scale, T_map_grid=T_map_grid)


def _search(targets: Sequence[DescribedMap], source: DescribedMap, config: MergeConfig) -> list[tuple[Hypothesis, ...]]:
    settings = config.robust.consensus.pairs
    peaks = search_motions([target.coarse for target in targets], source.coarse, settings.dense)
    return [
        find_hypotheses(target.structure, source.structure, [peak.T_target_source for peak in found], settings)
        for target, found in zip(targets, peaks, strict=True)
    ]


def _best_scale(
    target: DescribedMap, source: GridMap, found: Sequence[tuple[Hypothesis, ...]], config: MergeConfig
) -> _PairScale:
    """The scale under which the walls agree best: the best of the coarse ones, refined."""
    best = max(range(len(found)), key=lambda k: found[k][0].score_m if found[k] else -np.inf)
    if not found[best]:
        return _PairScale(0.0, -np.inf)
    motion = found[best][0]
    scale, T = _COARSE_SCALES[best], motion.T_target_source
    tightness = motion.evidence.tight_m
    settings = config.robust.consensus
    for step in _FINE_STEPS:
        for sign in (1.0, -1.0):
            while True:
                trial = scale + sign * step
                structure = extract_structure(scale_map(source, trial), settings.structure)
                T_trial = align_walls(target.structure, structure, T, settings.pairs.fine)
                evidence = measure_evidence(target.structure, structure, T_trial, settings.pairs.verification)
                if evidence.tight_m <= tightness:
                    break
                scale, T, tightness = trial, T_trial, evidence.tight_m
    return _PairScale(float(np.log(scale)), motion.log_odds)


def _average(pairs: dict[tuple[int, int], _PairScale], count: int, root: int, min_log_odds: float) -> Array:
    """Least absolute deviations of the sure pairs' logarithms (by reweighting); the root stays at 1."""
    sure = [(i, j, pair.log_scale) for (i, j), pair in sorted(pairs.items()) if pair.log_odds >= min_log_odds]
    log_scale = np.zeros(count)
    if not sure:
        return np.exp(log_scale)
    incidence = np.zeros((len(sure), count))
    for row, (i, j, _) in enumerate(sure):
        incidence[row, [i, j]] = -1.0, 1.0
    value = np.array([item[2] for item in sure])
    joined = _joined_to(root, [(i, j) for i, j, _ in sure], count)
    free = [k for k in range(count) if k != root and joined[k]]
    weights = np.ones(len(sure))
    for _ in range(30):
        root_weights = np.sqrt(weights)[:, None]
        solved = np.linalg.lstsq(root_weights * incidence[:, free], root_weights[:, 0] * value, rcond=None)[0]
        log_scale[free] = solved
        weights = 1.0 / np.maximum(np.abs(incidence @ log_scale - value), 1e-3)
    return np.exp(log_scale)


def _joined_to(root: int, edges: Sequence[tuple[int, int]], count: int) -> list[bool]:
    """Which of the maps edges join to the root."""
    joined = [k == root for k in range(count)]
    for _ in range(count):
        for i, j in edges:
            joined[i] = joined[j] = joined[i] or joined[j]
    return joined


def _quiet(stage: str, done: int, total: int) -> None:
    """Progress of a step that is part of another."""
