"""The paper's rival: merge two maps into one, then the next into that, in the order given [Blanco13]."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from merger import __version__, se2
from merger.assembly import composite_largest, require_one_resolution
from merger.compositing import composite_maps
from merger.features import match_many
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.motion_modes import MotionMode, agree, count_support, find_modes
from merger.pairwise import align_smaller
from merger.preparation import PreparedMap, prepare_map
from merger.random_streams import make_rng
from merger.result import MapPlacement, MergeResult, Objective, PairResult, PairStatus
from merger.stage_clock import StageClock
from merger.trimmed_icp import TrimmedIcpResult


@dataclass(frozen=True)
class _Hypothesis:
    """A mode after its refinement."""

    mode: MotionMode
    """The mode; its motion is the refined one, between the frames ``grid``."""
    T_initial: npt.NDArray[np.float64]
    """(3, 3) the mode's motion before the refinement."""
    refined: TrimmedIcpResult
    """What TrICP says."""


def merge_sequentially(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> MergeResult:
    """Merge one map after another into the first one, each time with features extracted afresh.

    It fails as such a method fails: a map that cannot be merged when its turn comes is left out, and a wrong one
    spoils the merged map for all that follow.

    Args:
        maps: The maps, in the order in which they are merged.
        config: Settings.
        progress: Called after each map.

    Returns:
        One component of the maps that were merged, each other map alone with its reason. The pairs are the steps:
        the target is the first map, in whose frame the merged map lies.
    """
    clock = StageClock()
    require_one_resolution(maps)
    merged, steps = maps[0], list[PairResult]()
    for number, source in enumerate(maps[1:], start=1):
        target = clock.run("features", prepare_map, merged, config.features)
        item = clock.run("features", prepare_map, source, config.features)
        step = clock.run("pairs", merge_next, replace(target, name=maps[0].name), item, config)
        if step.T_target_source is not None:
            merged = clock.run("compositing", _absorb, merged, source, step.T_target_source, config)
        steps.append(step)
        progress("maps", number, len(maps) - 1)
    placements = _place(maps, steps, str(config.reference))
    ordered = sorted(maps, key=lambda grid: grid.name)
    picture = clock.run("compositing", composite_largest, ordered, placements, config)
    result = _assemble(config, placements, steps, picture)
    return replace(result, runtime_s=clock.read())


def merge_next(target: PreparedMap, source: PreparedMap, config: MergeConfig) -> PairResult:
    """Find several motions, refine each by ICP, join those that agree, and take the one that is confirmed best.

    Confirmed is a motion by the source keypoints that lie on one of their candidates after the refinement; of
    equally confirmed ones the heavier mode wins.
    """
    settings = config.modes
    matches = match_many(target.features, source.features, settings.num_candidates)
    pair = PairResult(target.name, source.name, PairStatus.NO_MATCH, num_matches=len(matches))
    if target.edges is None or source.edges is None:
        return replace(pair, reason="a map has no wall to align")
    rng = make_rng(config.seed, target.name, source.name)
    modes = find_modes(target.features.points_grid, source.features.points_grid, matches, settings, rng)
    hypotheses = [_refine(target, source, mode, config) for mode in modes]
    joined = _join(hypotheses, source, config)
    supports = [_confirm(target, source, matches, hypothesis, config) for hypothesis in joined]
    if max(supports, default=0) < settings.min_support:
        reason = f"{max(supports, default=0)} keypoints agree on a motion, {settings.min_support} are needed"
        return replace(pair, num_inliers=max(supports, default=0), reason=reason)
    best = max(range(len(joined)), key=lambda index: (supports[index], joined[index].mode.weight))
    return _describe(pair, target, source, joined[best], supports[best])


def _refine(target: PreparedMap, source: PreparedMap, mode: MotionMode, config: MergeConfig) -> _Hypothesis:
    if target.edges is None or source.edges is None:
        raise ValueError("a map has no wall to align")
    refined = align_smaller(target.edges, source.edges, mode.T_target_source, config.icp)
    return _Hypothesis(replace(mode, T_target_source=refined.T_target_source), mode.T_target_source, refined)


def _join(hypotheses: list[_Hypothesis], source: PreparedMap, config: MergeConfig) -> list[_Hypothesis]:
    """One hypothesis for all that agree after the refinement: the heaviest, with the weights of all."""
    joined: list[_Hypothesis] = []
    for hypothesis in hypotheses:
        center = source.features.points_grid.mean(axis=0)
        motions = np.array([other.mode.T_target_source for other in joined]).reshape(-1, 3, 3)
        known = np.flatnonzero(agree(motions, hypothesis.mode.T_target_source, center, config.modes))
        if len(known):
            first = joined[known[0]]
            weight = first.mode.weight + hypothesis.mode.weight
            joined[known[0]] = replace(first, mode=replace(first.mode, weight=weight))
        else:
            joined.append(hypothesis)
    return joined


def _confirm(
    target: PreparedMap,
    source: PreparedMap,
    matches: npt.NDArray[np.intp],
    hypothesis: _Hypothesis,
    config: MergeConfig,
) -> int:
    """Source keypoints that the refined motion brings onto one of their candidates."""
    matches = matches[np.argsort(matches[:, 1], kind="stable")]
    places = target.features.points_grid[matches[:, 0]], source.features.points_grid[matches[:, 1]]
    motion = hypothesis.mode.T_target_source[None]
    return int(count_support(motion, *places, matches[:, 1], config.modes.match_distance_m)[0])


def _describe(
    pair: PairResult, target: PreparedMap, source: PreparedMap, best: _Hypothesis, support: int
) -> PairResult:
    T_source_map_grid = se2.invert(source.T_map_grid)
    return replace(
        pair,
        status=PairStatus.RELIABLE,
        T_target_source=target.T_map_grid @ best.mode.T_target_source @ T_source_map_grid,
        T_target_source_initial=target.T_map_grid @ best.T_initial @ T_source_map_grid,
        num_inliers=support,
        overlap=best.refined.overlap,
        rmse_m=best.refined.rmse_m,
        information=se2.chain_information(best.refined.information, T_source_map_grid),
        in_tree=True,
    )


def _absorb(merged: GridMap, source: GridMap, T_merged_source: npt.NDArray[np.float64], config: MergeConfig) -> GridMap:
    """The merged map with one more map in it, in the cells that it had."""
    motions = np.stack([np.eye(3), T_merged_source])
    return composite_maps([merged, source], motions, merged.T_map_grid, merged.resolution_m, config.compositing)


def _place(maps: Sequence[GridMap], steps: Sequence[PairResult], reference: str) -> tuple[MapPlacement, ...]:
    """Placements in the order of names: the merged maps in the reference's frame, the others alone."""
    first = maps[0].name
    fine = {step.source: step.T_target_source for step in steps if step.T_target_source is not None}
    coarse = {step.source: step.T_target_source_initial for step in steps if step.T_target_source_initial is not None}
    fine[first] = coarse[first] = np.eye(3)
    group = sorted(fine)
    root = reference if reference in fine else group[0]
    if len(group) == 1:
        return _place_nothing(maps, steps)
    placements = [
        MapPlacement(
            name,
            True,
            0,
            np.eye(3) if name == root else se2.invert(fine[root]) @ fine[name],
            np.eye(3) if name == root else se2.invert(coarse[root]) @ coarse[name],
        )
        for name in group
    ]
    left_out = sorted((step for step in steps if step.source not in fine), key=lambda step: step.source)
    placements += [
        MapPlacement(step.source, False, number, reason=f"not merged when its turn came: {step.reason}")
        for number, step in enumerate(left_out, start=1)
    ]
    return tuple(sorted(placements, key=lambda placement: placement.name))


def _place_nothing(maps: Sequence[GridMap], steps: Sequence[PairResult]) -> tuple[MapPlacement, ...]:
    reasons = {step.source: f"not merged when its turn came: {step.reason}" for step in steps}
    names = sorted(grid.name for grid in maps)
    return tuple(
        MapPlacement(name, False, number, reason=reasons.get(name, "no other map could be merged into it"))
        for number, name in enumerate(names)
    )


def _assemble(
    config: MergeConfig, placements: tuple[MapPlacement, ...], steps: Sequence[PairResult], merged: GridMap | None
) -> MergeResult:
    count = max(placement.component for placement in placements) + 1
    components = tuple(
        tuple(placement.name for placement in placements if placement.component == number) for number in range(count)
    )
    pairs = tuple(sorted(steps, key=lambda step: step.source))
    objective = Objective(num_reliable=sum(step.T_target_source is not None for step in steps))
    return MergeResult(
        config.method, config.seed, __version__, str(config.reference), placements, components, pairs, objective,
        merged=merged,
    )  # fmt: skip
