"""Draw spanning trees and confirm each by all motions: the paper's Algorithm 2."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger.motion_graph import MotionGraph, chain_motions
from merger.wilson import draw_trees

_TREES_AT_ONCE = 1 << 19
"""Motions held in memory at a time, over trees times maps and motions."""


@dataclass(frozen=True)
class SpanningTreeConfig:
    """Settings of sampling and confirming.

    Raises:
        ValueError: a setting is out of its range.
    """

    trees_per_squared_map: float = 10.0
    """Trees drawn for N maps: this times N squared, > 0 (the paper's 10 N^2)."""
    confirm_distance: float = 0.5
    """A motion agrees if the Frobenius norm of its difference is at most this (d_thr of Eq. 11), > 0; inf accepts all.

    The norm adds metres (at the maps' centres) and sines of angles.
    """

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not 0.0 < self.trees_per_squared_map < np.inf:
            raise ValueError(f"tree.trees_per_squared_map must be > 0, got {self.trees_per_squared_map}")
        if not self.confirm_distance > 0.0:
            raise ValueError(f"tree.confirm_distance must be > 0, got {self.confirm_distance}")


@dataclass(frozen=True)
class TreeResult:
    """The tree that most motions confirm."""

    T_root_map: npt.NDArray[np.float64]
    """(N, 3, 3) coarse global motions, chained along the tree from map 0."""
    tree: npt.NDArray[np.intp]
    """(N - 1,) edges of the tree."""
    reliable: npt.NDArray[np.bool_]
    """(E,) the motions that confirm it, its own included."""
    distances: npt.NDArray[np.float64]
    """(E,) how far each motion is from it: the norm of Eq. 11."""
    num_trees: int
    """Trees that were drawn."""


def sample_and_confirm(graph: MotionGraph, config: SpanningTreeConfig, rng: np.random.Generator) -> TreeResult:
    """Draw trees from the uniform distribution and keep the one that most relative motions confirm.

    Note: As printed, Algorithm 2 deletes edges inside its loop, never updates E_best, and says "if" where a loop is
    meant. Here motions are deleted after the loop, for the winner only; of equal trees the last wins, as printed.

    Args:
        graph: Relative motions that connect all maps, each map's frame in its middle.
        config: Settings.
        rng: Draws the trees.

    Returns:
        The coarse global motions, and which relative motions are reliable.

    Raises:
        ValueError: the motions do not connect the maps.
    """
    num_trees = max(1, int(np.ceil(config.trees_per_squared_map * graph.num_maps**2)))
    parent_edges = draw_trees(graph.num_maps, graph.edges, num_trees, rng)
    chunk = max(1, _TREES_AT_ONCE // max(1, graph.num_maps + len(graph.edges)))
    best, T_root_map, tree = -1, np.zeros((0, 3, 3)), np.zeros(0, dtype=np.intp)
    for start in range(0, num_trees, chunk):
        T = chain_motions(graph, parent_edges[start : start + chunk])
        counts = (_measure_distances(graph, T) <= config.confirm_distance).sum(axis=1)
        last = len(counts) - 1 - int(np.argmax(counts[::-1]))
        if counts[last] >= best:
            best, T_root_map, tree = int(counts[last]), T[last], parent_edges[start + last, 1:]
    distances = _measure_distances(graph, T_root_map[None])[0]
    return TreeResult(T_root_map, np.sort(tree), distances <= config.confirm_distance, distances, num_trees)


def _measure_distances(graph: MotionGraph, T_root_map: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(K, E) Frobenius norms of ``T_i_j - inv(T_i) @ T_j`` (Eq. 11) under (K, N, 3, 3) global motions."""
    i, j = graph.edges.T
    # Rotating by R_i does not change the norm: |T_i_j - inv(T_i) T_j| = |T_i T_i_j - T_j|.
    difference = T_root_map[:, i, :2] @ graph.T_i_j - T_root_map[:, j, :2]
    return np.asarray(np.sqrt(np.einsum("kead,kead->ke", difference, difference)))
