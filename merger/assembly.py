"""From global motions to the answer: each component in its reference's frame, each map with its reason."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from merger import __version__, se2
from merger.compositing import composite_maps
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig
from merger.motion_graph import MotionGraph
from merger.preparation import PreparedMap
from merger.result import MapPlacement, MergeResult, Objective, PairResult
from merger.stages import ConfirmedMotions, GlobalMotions


def sort_maps(maps: Sequence[GridMap]) -> list[GridMap]:
    """Put maps of one resolution in the order of their names, so that the order in which they came does not matter."""
    require_one_resolution(maps)
    return sorted(maps, key=lambda grid: grid.name)


def require_one_resolution(maps: Sequence[GridMap]) -> None:
    """Refuse maps that only the method `robust` can merge.

    Raises:
        ValueError: the maps differ in resolution.
    """
    for grid in maps[1:]:
        if not math.isclose(grid.resolution_m, maps[0].resolution_m, rel_tol=1e-6):
            raise ValueError(
                f"map '{grid.name}' has a resolution of {grid.resolution_m:g} m, map '{maps[0].name}' of "
                f"{maps[0].resolution_m:g} m: this method merges maps of one resolution only"
            )


def place_maps(
    prepared: Sequence[PreparedMap], fine: GlobalMotions, confirmed: ConfirmedMotions, config: MergeConfig
) -> tuple[MapPlacement, ...]:
    """Express the motions in the frame of each component's reference: the named map, else the first one."""
    coarse, pairs = confirmed.coarse, confirmed.pairs
    names = [item.name for item in prepared]
    placements = {}
    for number, members in enumerate(fine.components):
        if len(members) == 1:
            name = names[members[0]]
            placements[name] = MapPlacement(name, False, number, reason=_why_alone(name, pairs))
            continue
        root = next((member for member in members if names[member] == config.reference), members[0])
        for member in members:
            T_ref_map, T_ref_map_initial = (
                _move_to_reference(prepared[root], prepared[member], motions, root, member)
                for motions in (fine, coarse)
            )
            placements[names[member]] = MapPlacement(names[member], True, number, T_ref_map, T_ref_map_initial)
    return tuple(placements[name] for name in names)


def composite_largest(
    maps: Sequence[GridMap], placements: Sequence[MapPlacement], config: MergeConfig
) -> GridMap | None:
    """Merge the maps of component 0 into one grid, in the cells of its reference; None if it is not asked for."""
    if not config.composite:
        return None
    members = [index for index, placement in enumerate(placements) if placement.component == 0]
    motions = [placements[index].T_ref_map for index in members]
    T_ref_map = np.stack([np.eye(3) if T is None else T for T in motions])
    named = [index for index in members if placements[index].name == config.reference]
    reference = maps[named[0] if named else members[0]]
    resolution_m = config.resolution_m or reference.resolution_m
    chosen = [maps[index] for index in members]
    return composite_maps(chosen, T_ref_map, reference.T_map_grid, resolution_m, config.compositing)


def assemble_result(
    config: MergeConfig,
    placements: tuple[MapPlacement, ...],
    confirmed: ConfirmedMotions,
    fine: GlobalMotions,
    merged: GridMap | None,
) -> MergeResult:
    """Put the answer together; its times are still missing."""
    components = tuple(tuple(placements[index].name for index in members) for members in fine.components)
    return MergeResult(
        method=config.method,
        seed=config.seed,
        version=__version__,
        reference=str(config.reference),
        maps=placements,
        components=components,
        pairs=confirmed.pairs,
        objective=_measure_objective(confirmed, fine),
        merged=merged,
    )


def _measure_objective(confirmed: ConfirmedMotions, fine: GlobalMotions) -> Objective:
    """How well the coarse and the fine motions explain the reliable relative ones (see `Objective`)."""
    graph = confirmed.graph
    if len(graph.edges) == 0:
        return Objective(num_trees=confirmed.num_trees)
    initial, final = _residual_scale(graph, confirmed.coarse), _residual_scale(graph, fine)
    return Objective(initial[0], final[0], initial[1], final[1], confirmed.num_trees, len(graph.edges))


def _move_to_reference(
    root: PreparedMap, item: PreparedMap, motions: GlobalMotions, root_index: int, index: int
) -> npt.NDArray[np.float64]:
    """``T_ref_map`` of one map, exactly the identity for the reference itself."""
    if index == root_index:
        return np.eye(3)
    T_refcenter_center = se2.invert(motions.T_root_center[root_index]) @ motions.T_root_center[index]
    return np.asarray(root.T_map_center @ T_refcenter_center @ se2.invert(item.T_map_center))


def _why_alone(name: str, pairs: Sequence[PairResult]) -> str:
    """Why no motion joins a map to another one: its best pair's reason."""
    own = [pair for pair in pairs if name in (pair.target, pair.source)]
    if not own:
        return "there is no other map"
    best = max(own, key=lambda pair: pair.num_inliers or 0)
    other = best.source if best.target == name else best.target
    return f"no other map matches it; the best, '{other}': {best.reason}"


def _residual_scale(graph: MotionGraph, motions: GlobalMotions) -> tuple[float, float]:
    """Root mean square residual in metres at the source's middle, and in radians."""
    i, j = graph.edges.T
    T_i_j = se2.invert(motions.T_root_center[i]) @ motions.T_root_center[j]
    residuals = se2.log(se2.invert(graph.T_i_j) @ T_i_j)
    return float(np.sqrt((residuals[:, :2] ** 2).sum(axis=1).mean())), float(np.sqrt((residuals[:, 2] ** 2).mean()))
