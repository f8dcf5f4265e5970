"""The stages of the robust method over all maps, pairs and groups."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.motion_graph import MotionGraph
from merger.preparation import PreparedMap, prepare_map
from merger.random_streams import make_rng
from merger.robust.averaging import average_robustly
from merger.robust.coarse_map import CoarseMap, coarsen
from merger.robust.consensus import Agreement
from merger.robust.dense_search import search_motions
from merger.robust.feature_hypotheses import propose_motion
from merger.robust.forks import map_in_forks
from merger.robust.hypotheses import HypothesesConfig, Hypothesis, find_hypotheses, is_same_motion
from merger.robust.joint_refinement import refine_jointly
from merger.robust.map_group import PairHypotheses
from merger.robust.wall_alignment import motion_information
from merger.robust.wall_structure import WallStructure, extract_structure
from merger.stages import map_in_threads

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DescribedMap:
    """A map, ready to be compared."""

    structure: WallStructure
    """Its walls and look-up fields."""
    coarse: CoarseMap
    """Its cells of the dense search."""
    prepared: PreparedMap | None = None
    """Its keypoints, if they are used."""


@dataclass(frozen=True)
class PlacedGroup:
    """Where the maps of one component lie."""

    members: tuple[int, ...]
    """Numbers of the maps, rising."""
    T_first_map_initial: Array
    """(M, 3, 3) motions by consensus into the frame of the first member."""
    T_first_map: Array
    """(M, 3, 3) motions after averaging and joint refinement."""
    covariance: Array
    """(M, M, 3, 3) covariance of ``v = (x, y, theta)`` in ``T_first_map @ exp(v)``."""


def describe_maps(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> list[DescribedMap]:
    """Extract walls, look-up fields and coarse cells of all maps."""
    consensus = config.robust.consensus

    def work(grid: GridMap) -> DescribedMap:
        structure = extract_structure(grid, consensus.structure)
        prepared = prepare_map(grid, config.features) if config.robust.features else None
        return DescribedMap(structure, coarsen(structure, consensus.pairs.dense), prepared)

    return map_in_threads(work, maps, config.workers, "features", progress)


def search_all_pairs(described: Sequence[DescribedMap], config: MergeConfig, progress: Progress) -> PairHypotheses:
    """Find the motions in question of every pair: each map is searched for in all maps before it."""
    settings = config.robust.consensus.pairs

    def work(j: int) -> list[tuple[Hypothesis, ...]]:
        source, targets = described[j], described[:j]
        peaks = search_motions([target.coarse for target in targets], source.coarse, settings.dense)
        return [
            find_hypotheses(
                target.structure,
                source.structure,
                [*(peak.T_target_source for peak in found), *_from_features(target, source, config)],
                settings,
            )
            for target, found in zip(targets, peaks, strict=True)
        ]

    sources = range(len(described) - 1, 0, -1)
    found = map_in_forks(work, sources, config.workers, "pairs", progress)
    return {(i, j): motions for j, row in zip(sources, found, strict=True) for i, motions in enumerate(row)}


def _from_features(target: DescribedMap, source: DescribedMap, config: MergeConfig) -> list[Array]:
    """The motion that the paper's features propose, if they are used and propose one."""
    if target.prepared is None or source.prepared is None:
        return []
    rng = make_rng(config.seed, target.prepared.name, source.prepared.name)
    T = propose_motion(target.prepared, source.prepared, config.features, config.ransac, rng)
    return [] if T is None else [T]


def refine_groups(
    described: Sequence[DescribedMap], hypotheses: PairHypotheses, agreement: Agreement, config: MergeConfig
) -> tuple[PlacedGroup, ...]:
    """Average the confirmed motions of each group, then refine all its maps at once."""
    placed = []
    for group in agreement.groups:
        structures = [described[number].structure for number in group.members]
        T, covariance = group.T_group_map, np.zeros((len(group.members), len(group.members), 3, 3))
        if len(group.members) > 1 and config.robust.average:
            graph, information = _confirmed_motions(described, hypotheses, group.members, T, config)
            T = average_robustly(graph, information, T, config.robust.averaging)
        if len(group.members) > 1 and config.robust.refine_jointly:
            joint = refine_jointly(structures, T, config.robust.joint)
            T, covariance = joint.T_root_map, joint.covariance
        placed.append(PlacedGroup(group.members, group.T_group_map, T, covariance))
    return tuple(placed)


def confirmed_motion(
    hypotheses: Sequence[Hypothesis], T_target_source: Array, source: WallStructure, pairs: HypothesesConfig
) -> Hypothesis | None:
    """The motion in question that agrees with a placement, (3, 3) ``T_target_source``; None if there is none."""
    for hypothesis in hypotheses:
        if is_same_motion(hypothesis.T_target_source, T_target_source, source.center_map, pairs):
            return hypothesis
    return None


def _confirmed_motions(
    described: Sequence[DescribedMap],
    hypotheses: PairHypotheses,
    members: tuple[int, ...],
    T_group_map: Array,
    config: MergeConfig,
) -> tuple[MotionGraph, Array]:
    """The graph of the relative motions that agree with a group's placement, and their information."""
    edges, motions, information = [], [], []
    for (a, i), (b, j) in combinations(enumerate(members), 2):
        target, source = described[i].structure, described[j].structure
        T_i_j = se2.invert(T_group_map[a]) @ T_group_map[b]
        found = confirmed_motion(hypotheses.get((i, j), ()), T_i_j, source, config.robust.consensus.pairs)
        if found is None:
            continue
        edges.append((a, b))
        motions.append(found.T_target_source)
        variance = config.robust.joint.metre_variance_m3
        information.append(motion_information(target, source, found.T_target_source, variance))
    graph = MotionGraph(
        len(members), np.array(edges, dtype=np.intp).reshape(-1, 2), np.array(motions).reshape(-1, 3, 3)
    )
    return graph, np.array(information).reshape(-1, 3, 3)
