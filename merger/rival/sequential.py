"""The paper's rival: merge two maps into one, then the next into that, in the order given [Blanco13].

A step is the algorithm of J. L. Blanco, J. Gonzalez-Jimenez, J. A. Fernandez-Madrigal: A robust, multi-hypothesis
approach to matching occupancy grid maps, Robotica, 2013, with the settings of its original implementation in MRPT.

Note: The keypoints are SIFT's, as the paper says of its rival (Sec. 4.2); MRPT's own are Harris corners with images of
their surroundings in polar coordinates. MRPT's limit of a descriptor's distance (threshold_max) is made for those, and
hardly a match of SIFT's passes it; the margin to the best candidate serves alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.assembly import composite_largest, require_one_resolution
from merger.compositing import composite_maps
from merger.features import match_many
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.nearest_edges import EdgeIndex
from merger.preparation import PreparedMap, prepare_map
from merger.random_streams import make_rng
from merger.result import MergeResult, PairResult, PairStatus
from merger.rival.answer import assemble_steps, place_merged
from merger.rival.mode_reduction import reduce_modes
from merger.rival.motion_modes import MotionMode, find_modes
from merger.rival.shrinking_icp import ShrinkingIcpResult, align_points
from merger.stage_clock import StageClock

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Hypothesis:
    """A mode after its refinement."""

    mode: MotionMode
    """The mode; its mean is the refined motion, between the frames ``grid``."""
    T_initial: _Array
    """(3, 3) the mode's mean before the refinement."""
    refined: ShrinkingIcpResult
    """What ICP says."""


def merge_sequentially(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> MergeResult:
    """Merge one map after another into the first one, each time with features extracted afresh.

    It fails as such a method fails: a map that cannot be merged when its turn comes is left out, and a wrong one
    spoils the merged map for all that follow. The merged map has as many keypoints for its area as any map, so that
    the next map is an ever smaller part of it.

    Args:
        maps: The maps, in the order in which they are merged.
        config: Settings.
        progress: Called when the compiler starts and ends, and after each map.

    Returns:
        One component of the maps that were merged, each other map alone with its reason. The pairs are the steps:
        the target is the first map, in whose frame the merged map lies.
    """
    clock = StageClock()
    require_one_resolution(maps)
    clock.run("pairs", _load_kernel, progress)
    merged, steps = maps[0], list[PairResult]()
    for number, source in enumerate(maps[1:], start=1):
        target = clock.run("features", _prepare, merged, config)
        item = clock.run("features", _prepare, source, config)
        step = clock.run("pairs", merge_next, replace(target, name=maps[0].name), item, config)
        if step.T_target_source is not None:
            merged = clock.run("compositing", _absorb, merged, source, step.T_target_source, config)
        steps.append(step)
        progress("maps", number, len(maps) - 1)
    placements = place_merged(maps, steps, str(config.reference))
    ordered = sorted(maps, key=lambda grid: grid.name)
    picture = clock.run("compositing", composite_largest, ordered, placements, config)
    result = assemble_steps(config, placements, steps, picture)
    return replace(result, runtime_s=clock.read())


def _load_kernel(progress: Progress) -> None:
    """Compile, or load, the kernel of the modified RANSAC: a first run would else be silent for seconds."""
    from merger.rival.growth_kernel import grow_set  # noqa: PLC0415 # numba is slow to load

    progress("compiler", 0, 1)
    corners = np.array([[0.0, 0.0], [1.0, 0.0]])
    grow_set(corners, corners, np.array([[0, 0], [1, 1]]), 0.1, 1.0)
    progress("compiler", 1, 1)


def merge_next(target: PreparedMap, source: PreparedMap, config: MergeConfig) -> PairResult:
    """Find several motions, refine each by ICP, merge those that agree, and take the heaviest that is left.

    A motion is refused if ICP matches too few points or moves it farther than its mode is wide.
    """
    candidates = match_many(target.features, source.features, config.modes.candidate_margin)
    pair = PairResult(target.name, source.name, PairStatus.NO_MATCH, num_matches=len(candidates))
    if target.edges is None or source.edges is None:
        return replace(pair, reason="a map has no wall to align")
    rng = make_rng(config.seed, target.name, source.name)
    found = find_modes(target.features.points_grid, source.features.points_grid, candidates, config.modes, rng)
    if not found:
        return replace(pair, reason="no motion is supported by enough keypoints")
    modes = reduce_modes(found, config.modes.max_divergence)
    hypotheses = [_refine(target.edges, source.edges, mode, config) for mode in modes]
    accepted = [hypothesis for hypothesis in hypotheses if _is_accepted(hypothesis, config)]
    if not accepted:
        return replace(pair, reason=f"ICP confirms none of {len(modes)} motions")
    best = reduce_modes([hypothesis.mode for hypothesis in accepted], config.modes.max_divergence)[0]
    shifts = [se2.log(se2.invert(best.T_target_source) @ other.mode.T_target_source) for other in accepted]
    nearest = accepted[int(np.argmin(np.abs(shifts).max(axis=1)))]
    return _describe(pair, target, source, replace(nearest, mode=best))


def _prepare(grid: GridMap, config: MergeConfig) -> PreparedMap:
    """The map's edge points and its strongest keypoints, as many as its area grants."""
    known = grid.log_odds != 0.0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    num_cells = int(np.ptp(rows) + 1) * int(np.ptp(cols) + 1) if len(rows) else 0
    granted = round(num_cells * grid.resolution_m**2 * config.modes.keypoints_per_m2)
    return prepare_map(grid, replace(config.features, max_keypoints=max(config.modes.min_keypoints, granted)))


def _refine(target: EdgeIndex, source: EdgeIndex, mode: MotionMode, config: MergeConfig) -> _Hypothesis:
    refined = align_points(target, source.points_grid, mode.T_target_source, config.shrinking_icp)
    return _Hypothesis(replace(mode, T_target_source=refined.T_target_source), mode.T_target_source, refined)


def _is_accepted(hypothesis: _Hypothesis, config: MergeConfig) -> bool:
    """Whether ICP matches enough points, and ends within the mode's width (Mahalanobis; both motions are uncertain)."""
    shift = se2.parameters_of(hypothesis.mode.T_target_source) - se2.parameters_of(hypothesis.T_initial)
    shift[2] = se2.wrap_angle(shift[2])
    squared = float(shift @ np.linalg.solve(2.0 * hypothesis.mode.covariance, shift))
    settings = config.shrinking_icp
    return hypothesis.refined.goodness > settings.min_goodness and squared < settings.max_shift**2


def _describe(pair: PairResult, target: PreparedMap, source: PreparedMap, best: _Hypothesis) -> PairResult:
    T_source_map_grid = se2.invert(source.T_map_grid)
    turn = best.mode.T_target_source.copy()
    turn[:2, 2] = 0.0
    information = turn.T @ np.linalg.inv(best.mode.covariance) @ turn
    return replace(
        pair,
        status=PairStatus.RELIABLE,
        T_target_source=target.T_map_grid @ best.mode.T_target_source @ T_source_map_grid,
        T_target_source_initial=target.T_map_grid @ best.T_initial @ T_source_map_grid,
        num_inliers=len(best.mode.matches),
        overlap=best.refined.goodness,
        rmse_m=best.refined.rmse_m,
        information=se2.chain_information(information, T_source_map_grid),
        in_tree=True,
    )


def _absorb(merged: GridMap, source: GridMap, T_merged_source: _Array, config: MergeConfig) -> GridMap:
    """The merged map with one more map in it, in the cells that it had."""
    motions = np.stack([np.eye(3), T_merged_source])
    return composite_maps([merged, source], motions, merged.T_map_grid, merged.resolution_m, config.compositing)
