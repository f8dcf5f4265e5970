"""Shortest paths on a grid, as a sparse graph of its cells that scipy searches."""

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]
Predecessors = npt.NDArray[np.int32]

_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Half of the eight neighbours; the graph is undirected."""


def grid_graph(passable: Mask, cost: Array) -> sparse.csr_array:
    """The graph of passable cells, eight neighbours each; diagonal steps never cut a corner.

    Args:
        passable: (H, W) cells that may be entered.
        cost: (H, W) positive cost of a metre (or cell) travelled in each cell.

    Returns:
        (H * W, H * W) symmetric graph; a node is ``row * W + col``, an edge the mean cost times the step in cells.
    """
    rows, cols = passable.shape
    nodes = np.arange(rows * cols).reshape(rows, cols)
    sources, targets, weights = [], [], []
    for d_row, d_col in _STEPS:
        here, there = _shifted(d_row, d_col, rows, cols)
        allowed = passable[here] & passable[there]
        if d_row and d_col:
            allowed &= passable[here[0], there[1]] & passable[there[0], here[1]]
        sources.append(nodes[here][allowed])
        targets.append(nodes[there][allowed])
        weights.append((0.5 * (cost[here] + cost[there]) * np.hypot(d_row, d_col))[allowed])
    i, j, w = (np.concatenate(v) for v in (sources, targets, weights))
    both = (np.concatenate([w, w]), (np.concatenate([i, j]), np.concatenate([j, i])))
    return sparse.csr_array(both, shape=(rows * cols, rows * cols))


def search(graph: sparse.csr_array, source: int, limit: float = np.inf) -> tuple[Array, Predecessors]:
    """Shortest ways from one node to all: (V,) costs (inf beyond the limit) and the (V,) nodes before each."""
    costs, before = dijkstra(graph, indices=np.array([source]), return_predecessors=True, limit=limit)
    return np.asarray(costs[0], dtype=np.float64), np.asarray(before[0], dtype=np.int32)


def search_nearest(graph: sparse.csr_array, sources: Indices, limit: float = np.inf) -> tuple[Array, Indices]:
    """The nearest of several nodes: (V,) cost of the way from it (inf beyond the limit), and (V,) which it is."""
    costs, _, nearest = dijkstra(graph, indices=sources, return_predecessors=True, limit=limit, min_only=True)
    return np.asarray(costs, dtype=np.float64), np.asarray(nearest, dtype=np.int64)


def trace_path(predecessors: Predecessors, node: int) -> Indices:
    """(L,) nodes from a search's source to this node, by the predecessors that scipy's ``dijkstra`` gives."""
    path = [node]
    while predecessors[path[-1]] >= 0:
        path.append(int(predecessors[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _shifted(d_row: int, d_col: int, rows: int, cols: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of the cells that have this neighbour, and of the neighbours."""
    left = slice(0, cols - d_col) if d_col >= 0 else slice(-d_col, cols)
    right = slice(d_col, cols) if d_col >= 0 else slice(0, cols + d_col)
    return (slice(0, rows - d_row), left), (slice(d_row, rows), right)
