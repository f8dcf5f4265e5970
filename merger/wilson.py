"""Uniformly random spanning trees by loop-erased random walks [Wilson, STOC 1996], many at once."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class _Neighbours:
    """The graph, map by map; of each row only the first ``degree`` entries count."""

    degree: npt.NDArray[np.intp]
    """(N,) edges at each map."""
    incident: npt.NDArray[np.intp]
    """(N, D) the edges."""
    neighbour: npt.NDArray[np.intp]
    """(N, D) the maps at their other ends."""


def draw_trees(
    num_maps: int, edges: npt.NDArray[np.intp], num_trees: int, rng: np.random.Generator
) -> npt.NDArray[np.intp]:
    """Draw spanning trees from the uniform distribution over all of them, rooted at map 0.

    From each map in turn a random walk runs until it meets the tree; each map remembers only the edge by which it
    was left last, which erases the loops. All trees are walked side by side.

    Note: The paper draws N - 1 edges until they connect all maps (Eq. 9). The trees that remain have exactly this
    distribution, but the loop needs millions of draws for a few dozen maps, and never ends if there is no tree.

    Args:
        num_maps: N, at least 1.
        edges: (E, 2) undirected edges between the maps 0..N-1, which connect them all.
        num_trees: K.
        rng: Directs the walks.

    Returns:
        (K, N) edge that leads from each map to its parent; -1 at map 0.

    Raises:
        ValueError: the edges do not connect the maps.
    """
    graph = _list_neighbours(num_maps, edges)
    if not _is_connected(graph):
        raise ValueError(f"the {len(edges)} edges do not connect the {num_maps} maps: there is no spanning tree")
    exit_slot = np.zeros((num_trees, num_maps), dtype=np.intp)
    in_tree = np.zeros((num_trees, num_maps), dtype=np.bool_)
    in_tree[:, 0] = True
    for start in range(1, num_maps):
        _walk(start, in_tree, exit_slot, graph, rng)
        _retrace(start, in_tree, exit_slot, graph)
    parent_edge = graph.incident[np.arange(num_maps), exit_slot]
    parent_edge[:, 0] = -1
    return np.asarray(parent_edge)


def _list_neighbours(num_maps: int, edges: npt.NDArray[np.intp]) -> _Neighbours:
    degree = np.bincount(edges.ravel(), minlength=num_maps)
    incident = np.zeros((num_maps, max(1, int(degree.max(initial=0)))), dtype=np.intp)
    neighbour = np.zeros_like(incident)
    filled = np.zeros(num_maps, dtype=np.intp)
    for index, (i, j) in enumerate(edges.tolist()):
        for here, there in ((i, j), (j, i)):
            incident[here, filled[here]], neighbour[here, filled[here]] = index, there
            filled[here] += 1
    return _Neighbours(degree, incident, neighbour)


def _is_connected(graph: _Neighbours) -> bool:
    seen, frontier = {0}, [0]
    while frontier:
        node = frontier.pop()
        fresh = set(graph.neighbour[node, : graph.degree[node]].tolist()) - seen
        seen |= fresh
        frontier.extend(fresh)
    return len(seen) == len(graph.degree)


def _walk(
    start: int,
    in_tree: npt.NDArray[np.bool_],
    exit_slot: npt.NDArray[np.intp],
    graph: _Neighbours,
    rng: np.random.Generator,
) -> None:
    """Walk from one map until every walk has met its tree; writes the last exits of the maps passed."""
    tree = np.flatnonzero(~in_tree[:, start])
    node = np.full(len(tree), start, dtype=np.intp)
    while len(tree):
        slot = (rng.random(len(tree)) * graph.degree[node]).astype(np.intp)
        exit_slot[tree, node] = slot
        node = graph.neighbour[node, slot]
        still = ~in_tree[tree, node]
        tree, node = tree[still], node[still]


def _retrace(start: int, in_tree: npt.NDArray[np.bool_], exit_slot: npt.NDArray[np.intp], graph: _Neighbours) -> None:
    """Follow the last exits from the start, and add the maps on the way to the trees."""
    tree = np.flatnonzero(~in_tree[:, start])
    node = np.full(len(tree), start, dtype=np.intp)
    while len(tree):
        in_tree[tree, node] = True
        node = graph.neighbour[node, exit_slot[tree, node]]
        still = ~in_tree[tree, node]
        tree, node = tree[still], node[still]
