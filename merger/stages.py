"""The stages of a merge over all maps and pairs: each runs one algorithm's file on every map, pair or component."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig, Progress
from merger.motion_averaging import average_motions
from merger.motion_graph import MotionGraph, find_components, select_subgraph
from merger.pairwise import merge_pair
from merger.preparation import PreparedMap, prepare_map
from merger.random_streams import make_rng
from merger.result import PairResult, PairStatus
from merger.spanning_tree import sample_and_confirm

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")


@dataclass(frozen=True)
class GlobalMotions:
    """Global motions of N maps, each in its middle's frame ``center``, by component."""

    components: tuple[tuple[int, ...], ...]
    """Maps of each component: largest first, then by first map; the first map is the root."""
    T_root_center: npt.NDArray[np.float64]
    """(N, 3, 3) motions into the root of the map's component."""


@dataclass(frozen=True)
class ConfirmedMotions:
    """What Algorithm 2 makes of all relative motions."""

    coarse: GlobalMotions
    """Global motions chained along the best tree of each component."""
    graph: MotionGraph
    """The reliable relative motions, frames ``center``."""
    pairs: tuple[PairResult, ...]
    """The pairs with their verdict."""
    num_trees: int
    """Trees drawn in all components."""


def map_in_threads(
    work: Callable[[_Item], _Answer], items: Sequence[_Item], workers: int, stage: str, progress: Progress
) -> list[_Answer]:
    """Do the same work on every item, in threads; the answers come in the items' order."""
    progress(stage, 0, len(items))
    answers: list[_Answer] = []
    with ThreadPoolExecutor(max_workers=workers) as pool:
        for answer in pool.map(work, items) if workers > 1 else map(work, items):
            answers.append(answer)
            progress(stage, len(answers), len(items))
    return answers


def prepare_maps(maps: Sequence[GridMap], config: MergeConfig, progress: Progress) -> list[PreparedMap]:
    """Extract keypoints and edge points of all maps."""
    return map_in_threads(lambda grid: prepare_map(grid, config.features), maps, config.workers, "features", progress)


def merge_all_pairs(prepared: Sequence[PreparedMap], config: MergeConfig, progress: Progress) -> list[PairResult]:
    """Run Algorithm 1 on every pair of maps, each with a random stream of its own."""

    def work(pair: tuple[PreparedMap, PreparedMap]) -> PairResult:
        rng = make_rng(config.seed, pair[0].name, pair[1].name)
        return merge_pair(*pair, config.pairwise, rng)

    return map_in_threads(work, list(combinations(prepared, 2)), config.workers, "pairs", progress)


def confirm_motions(
    prepared: Sequence[PreparedMap], pairs: Sequence[PairResult], config: MergeConfig
) -> ConfirmedMotions:
    """Run Algorithm 2 on each component of the graph of all relative motions."""
    found = [index for index, pair in enumerate(pairs) if pair.T_target_source is not None]
    graph = make_graph(prepared, [pairs[index] for index in found])
    components = find_components(graph.num_maps, graph.edges)
    T_root_center = np.tile(np.eye(3), (graph.num_maps, 1, 1))
    verdicts, reliable, num_trees = list(pairs), np.zeros(len(found), dtype=np.bool_), 0
    for members in (group for group in components if len(group) > 1):
        part, edges = select_subgraph(graph, members)
        rng = make_rng(config.seed, *(prepared[member].name for member in members))
        tree = sample_and_confirm(part, config.tree, rng)
        T_root_center[members] = tree.T_root_map
        reliable[edges] = tree.reliable
        num_trees += tree.num_trees
        for edge, distance in enumerate(tree.distances):
            index = found[edges[edge]]
            verdicts[index] = _judge(pairs[index], bool(tree.reliable[edge]), edge in tree.tree, float(distance))
    coarse = GlobalMotions(tuple(tuple(group) for group in components), T_root_center)
    kept = MotionGraph(graph.num_maps, graph.edges[reliable], graph.T_i_j[reliable])
    return ConfirmedMotions(coarse, kept, tuple(verdicts), num_trees)


def refine_motions(confirmed: ConfirmedMotions, config: MergeConfig) -> GlobalMotions:
    """Run Algorithm 3 on each component."""
    T_root_center = confirmed.coarse.T_root_center.copy()
    for members in confirmed.coarse.components:
        part, _ = select_subgraph(confirmed.graph, members)
        T_root_center[list(members)] = average_motions(part, T_root_center[list(members)], config.averaging).T_root_map
    return GlobalMotions(confirmed.coarse.components, T_root_center)


def make_graph(prepared: Sequence[PreparedMap], pairs: Sequence[PairResult]) -> MotionGraph:
    """The graph of these pairs' motions, moved from the frames ``map`` to ``center``.

    Args:
        prepared: The maps.
        pairs: Pairs that all have a motion.
    """
    index = {item.name: number for number, item in enumerate(prepared)}
    T_map_center = np.stack([item.T_map_center for item in prepared])
    edges = np.array([(index[pair.target], index[pair.source]) for pair in pairs], dtype=np.intp).reshape(-1, 2)
    T_target_source = np.array([pair.T_target_source for pair in pairs], dtype=np.float64).reshape(-1, 3, 3)
    T_i_j = se2.invert(T_map_center[edges[:, 0]]) @ T_target_source @ T_map_center[edges[:, 1]]
    return MotionGraph(len(prepared), edges, T_i_j)


def _judge(pair: PairResult, reliable: bool, in_tree: bool, distance: float) -> PairResult:
    if reliable:
        return replace(pair, status=PairStatus.RELIABLE, reason=None, in_tree=in_tree)
    return replace(
        pair, status=PairStatus.REJECTED, reason=f"the other motions contradict it: it is {distance:.2f} off the tree"
    )
