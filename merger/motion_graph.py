"""The graph of maps and relative motions: its components, and chaining along a tree (Sec. 3.2, Eq. 8)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2


@dataclass(frozen=True)
class MotionGraph:
    """Maps 0..N-1 and E relative motions between them.

    Raises:
        ValueError: the arrays do not fit together, or an index is out of range.
    """

    num_maps: int
    """N."""
    edges: npt.NDArray[np.intp]
    """(E, 2) maps ``(i, j)`` of each motion: i stays, j moves."""
    T_i_j: npt.NDArray[np.float64]
    """(E, 3, 3) relative motions: points of j into the frame of i."""

    def __post_init__(self) -> None:
        """Refuse what is no graph."""
        if self.edges.ndim != 2 or self.edges.shape[1] != 2 or self.T_i_j.shape != (len(self.edges), 3, 3):
            raise ValueError(f"graph: edges {self.edges.shape} and motions {self.T_i_j.shape} do not fit together")
        if len(self.edges) and not (self.edges.min() >= 0 and self.edges.max() < self.num_maps):
            raise ValueError(f"graph: an edge names a map outside 0..{self.num_maps - 1}")
        if (self.edges[:, 0] == self.edges[:, 1]).any():
            raise ValueError("graph: an edge joins a map with itself")


def find_components(num_maps: int, edges: npt.NDArray[np.intp]) -> list[list[int]]:
    """Split 0..N-1 into the components that the (E, 2) edges connect: largest first, then by first index; sorted."""
    parent = list(range(num_maps))

    def root_of(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for i, j in edges.tolist():
        parent[root_of(i)] = root_of(j)
    groups: dict[int, list[int]] = {}
    for node in range(num_maps):
        groups.setdefault(root_of(node), []).append(node)
    return sorted(groups.values(), key=lambda group: (-len(group), group[0]))


def select_subgraph(graph: MotionGraph, members: Sequence[int]) -> tuple[MotionGraph, npt.NDArray[np.intp]]:
    """Take the graph of some maps alone, renumbered 0.. in the order given.

    Returns:
        The smaller graph, and the (E',) indices of its edges in the larger one.
    """
    new_index = np.full(graph.num_maps, -1, dtype=np.intp)
    new_index[list(members)] = np.arange(len(members))
    renumbered = new_index[graph.edges]
    kept = np.flatnonzero((renumbered >= 0).all(axis=1))
    return MotionGraph(len(members), renumbered[kept], graph.T_i_j[kept]), kept


def chain_motions(graph: MotionGraph, parent_edge: npt.NDArray[np.intp]) -> npt.NDArray[np.float64]:
    """Chain relative motions from the root along spanning trees: ``T_root_j = T_root_i @ T_i_j`` (Eq. 8).

    All trees at once, by pointer doubling: each round replaces a map's parent by its grandparent.

    Args:
        graph: The motions.
        parent_edge: (K, N) edge that leads from each map to its parent in each of K trees; -1 at the root.

    Returns:
        (K, N, 3, 3) motions ``T_root_map``.
    """
    is_root = parent_edge < 0
    ends = graph.edges[parent_edge]
    node = np.broadcast_to(np.arange(graph.num_maps), parent_edge.shape)
    forward = ends[..., 1] == node
    parent = np.where(is_root, node, np.where(forward, ends[..., 0], ends[..., 1]))
    T_both = np.concatenate([graph.T_i_j, se2.invert(graph.T_i_j), np.eye(3)[None]])
    num_edges = len(graph.edges)
    T_parent_map = T_both[np.where(is_root, 2 * num_edges, np.where(forward, parent_edge, parent_edge + num_edges))]
    row = np.arange(len(parent_edge))[:, None]
    while not is_root[row, parent].all():
        T_parent_map = T_parent_map[row, parent] @ T_parent_map
        parent = parent[row, parent]
    return np.asarray(T_parent_map)
