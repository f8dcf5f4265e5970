from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, chi2_contingency

from merger import se2
from merger.motion_graph import MotionGraph, chain_motions, find_components, select_subgraph
from merger.spanning_tree import SpanningTreeConfig, sample_and_confirm
from merger.wilson import draw_trees

_EDGES = np.array([(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)])
"""A square with one diagonal: 8 spanning trees."""


def _spans(num_maps, edges):
    return len(find_components(num_maps, np.asarray(edges).reshape(-1, 2))) == 1


def _all_trees(num_maps, edges):
    return [tree for tree in combinations(range(len(edges)), num_maps - 1) if _spans(num_maps, edges[list(tree)])]


def _draw_by_rejection(num_maps, edges, rng):
    """The printed loop of Algorithm 2: draw N - 1 edges until the matrix g of Eq. 9 has no zero."""
    while True:
        chosen = rng.choice(len(edges), size=num_maps - 1, replace=False)
        L = np.zeros((num_maps, num_maps), dtype=np.int64)
        L[tuple(edges[chosen].T)] = 1
        if np.linalg.matrix_power(L + L.T + np.eye(num_maps, dtype=np.int64), num_maps).all():
            return tuple(sorted(chosen.tolist()))


def _count_wilson(num_maps, edges, num_trees, seed):
    trees = draw_trees(num_maps, edges, num_trees, np.random.default_rng(seed))
    return Counter(tuple(sorted(row[1:].tolist())) for row in trees)


def _random_graph(rng, num_maps, num_edges):
    path = [(i, i + 1) for i in range(num_maps - 1)]
    others = [pair for pair in combinations(range(num_maps), 2) if pair not in path]
    extra = rng.permutation(len(others))[: num_edges - len(path)]
    return np.array(path + [others[index] for index in extra])


def test_trees_come_from_the_uniform_distribution():
    trees = _all_trees(4, _EDGES)
    counts = _count_wilson(4, _EDGES, 20_000, seed=0)
    assert set(counts) == set(trees)
    expected = 20_000 / len(trees)
    statistic = sum((counts[tree] - expected) ** 2 / expected for tree in trees)
    assert statistic < chi2.ppf(0.999, len(trees) - 1)


def test_trees_come_as_often_as_by_the_printed_rejection_loop():
    rng = np.random.default_rng(1)
    edges = np.array([(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (0, 2), (1, 3)])
    printed = Counter(_draw_by_rejection(5, edges, rng) for _ in range(4000))
    wilson = _count_wilson(5, edges, 4000, seed=2)
    trees = _all_trees(5, edges)
    assert set(printed) == set(wilson) == set(trees)
    table = np.array([[counts[tree] for tree in trees] for counts in (printed, wilson)])
    assert chi2_contingency(table).pvalue > 0.001


def test_the_same_chi_square_test_tells_a_draw_that_prefers_one_tree_a_little():
    trees = _all_trees(4, _EDGES)
    weights = np.ones(len(trees))
    weights[3] = 1.2
    draws = np.random.default_rng(3).choice(len(trees), size=20_000, p=weights / weights.sum())
    expected = 20_000 / len(trees)
    statistic = ((np.bincount(draws, minlength=len(trees)) - expected) ** 2 / expected).sum()
    assert statistic > chi2.ppf(0.999, len(trees) - 1)


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 9), st.integers(0, 12), st.integers(0, 10_000))
def test_every_draw_is_a_spanning_tree_rooted_at_map_0(num_maps, extra, seed):
    rng = np.random.default_rng(seed)
    most = num_maps * (num_maps - 1) // 2
    edges = _random_graph(rng, num_maps, min(most, num_maps - 1 + extra))
    for row in draw_trees(num_maps, edges, 20, rng):
        assert row[0] == -1
        assert _spans(num_maps, edges[row[1:]])
        assert all(node in edges[row[node]] for node in range(1, num_maps))


def test_a_disconnected_graph_is_refused_instead_of_an_endless_loop():
    with pytest.raises(ValueError, match="do not connect the 4 maps"):
        draw_trees(4, np.array([(0, 1), (2, 3)]), 10, np.random.default_rng(0))


def test_components_are_sorted_by_size_and_then_by_first_map():
    edges = np.array([(6, 5), (1, 3), (4, 2), (2, 0)])
    assert find_components(8, edges) == [[0, 2, 4], [1, 3], [5, 6], [7]]


def _graph_of(poses, edges, errors=None):
    i, j = edges.T
    T = se2.invert(poses[i]) @ poses[j]
    return MotionGraph(len(poses), edges, T if errors is None else T @ se2.exp(errors))


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 8), st.integers(0, 10_000))
def test_chains_along_any_tree_give_the_true_motions_if_all_relative_ones_are_true(num_maps, seed):
    rng = np.random.default_rng(seed)
    poses = se2.exp(rng.normal(size=(num_maps, 3)) * np.array([10, 10, 1]))
    edges = _random_graph(rng, num_maps, min(num_maps * (num_maps - 1) // 2, num_maps + 2))
    graph = _graph_of(poses, edges)
    T_root_map = chain_motions(graph, draw_trees(num_maps, edges, 5, rng))
    assert np.allclose(T_root_map, se2.invert(poses[0]) @ poses, atol=1e-8)


def test_motions_that_contradict_the_others_are_rejected_and_no_others():
    rng = np.random.default_rng(7)
    num_maps = 8
    poses = se2.exp(rng.normal(size=(num_maps, 3)) * np.array([10, 10, 1]))
    edges = np.array(list(combinations(range(num_maps), 2)))
    errors = rng.normal(scale=0.01, size=(len(edges), 3))
    wrong = np.zeros(len(edges), dtype=bool)
    wrong[rng.permutation(len(edges))[:6]] = True
    errors[wrong] = rng.uniform(1.0, 3.0, size=(6, 3))
    tree = sample_and_confirm(_graph_of(poses, edges, errors), SpanningTreeConfig(), rng)
    assert (tree.reliable == ~wrong).all()
    assert (tree.distances[wrong] > 0.5).all()
    assert not wrong[tree.tree].any()
    assert tree.num_trees == 10 * num_maps**2


def test_an_infinite_threshold_confirms_everything():
    rng = np.random.default_rng(8)
    poses = se2.exp(rng.normal(size=(5, 3)))
    edges = np.array(list(combinations(range(5), 2)))
    graph = _graph_of(poses, edges, rng.normal(size=(len(edges), 3)))
    assert sample_and_confirm(graph, SpanningTreeConfig(confirm_distance=np.inf), rng).reliable.all()


def test_many_trees_in_chunks_give_what_one_chunk_gives(monkeypatch):
    rng = np.random.default_rng(9)
    poses = se2.exp(rng.normal(size=(6, 3)) * 3)
    edges = np.array(list(combinations(range(6), 2)))
    graph = _graph_of(poses, edges, rng.normal(scale=0.2, size=(len(edges), 3)))
    whole = sample_and_confirm(graph, SpanningTreeConfig(), np.random.default_rng(1))
    monkeypatch.setattr("merger.spanning_tree._TREES_AT_ONCE", 60)
    parts = sample_and_confirm(graph, SpanningTreeConfig(), np.random.default_rng(1))
    assert (whole.tree == parts.tree).all()
    assert (whole.T_root_map == parts.T_root_map).all()


def test_a_subgraph_keeps_the_motions_between_its_maps():
    rng = np.random.default_rng(10)
    poses = se2.exp(rng.normal(size=(6, 3)))
    graph = _graph_of(poses, np.array([(0, 1), (1, 2), (3, 4), (4, 5), (2, 5)]))
    part, kept = select_subgraph(graph, [3, 4, 5])
    assert kept.tolist() == [2, 3]
    assert part.edges.tolist() == [[0, 1], [1, 2]]
    assert (part.T_i_j == graph.T_i_j[kept]).all()


def test_a_graph_with_an_edge_to_nowhere_is_refused():
    with pytest.raises(ValueError, match=r"outside 0\.\.1"):
        MotionGraph(2, np.array([(0, 2)]), np.eye(3)[None])
    with pytest.raises(ValueError, match="itself"):
        MotionGraph(2, np.array([(1, 1)]), np.eye(3)[None])
