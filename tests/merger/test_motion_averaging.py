from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.motion_averaging import MotionAveragingConfig, average_motions
from merger.motion_graph import MotionGraph, chain_motions
from merger.wilson import draw_trees


def _noisy_graph(seed, num_maps, sigma):
    rng = np.random.default_rng(seed)
    poses = se2.exp(rng.normal(size=(num_maps, 3)) * np.array([10, 10, 1.5]))
    path = [(i, i + 1) for i in range(num_maps - 1)]
    others = [pair for pair in combinations(range(num_maps), 2) if pair not in path]
    edges = np.array(path + [others[i] for i in rng.permutation(len(others))[: 2 * num_maps]])
    T = se2.invert(poses[edges[:, 0]]) @ poses[edges[:, 1]] @ se2.exp(rng.normal(scale=sigma, size=(len(edges), 3)))
    graph = MotionGraph(num_maps, edges, T)
    coarse = chain_motions(graph, draw_trees(num_maps, edges, 1, rng))[0]
    return graph, coarse, se2.invert(poses[0]) @ poses


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 9), st.integers(0, 10_000))
def test_exact_relative_motions_give_the_exact_global_ones_from_a_perturbed_start(num_maps, seed):
    graph, _, truth = _noisy_graph(seed, num_maps, 0.0)
    noise = np.random.default_rng(seed).normal(scale=0.05, size=(num_maps, 3))
    noise[0] = 0.0
    result = average_motions(graph, se2.exp(noise) @ truth, MotionAveragingConfig())
    assert result.converged
    assert np.allclose(result.T_root_map, truth, atol=1e-8)


@settings(max_examples=20, deadline=None)
@given(st.integers(3, 9), st.integers(0, 10_000), st.data())
def test_the_converged_answer_does_not_depend_on_the_reference(num_maps, seed, data):
    graph, coarse, _ = _noisy_graph(seed, num_maps, 0.02)
    order = np.array(data.draw(st.permutations(range(num_maps))))
    place = np.argsort(order)
    renamed = MotionGraph(num_maps, place[graph.edges], graph.T_i_j)
    first = average_motions(graph, coarse, MotionAveragingConfig())
    start = se2.invert(coarse[order[0]]) @ coarse[order]
    second = average_motions(renamed, start, MotionAveragingConfig())
    assert first.converged
    assert second.converged
    expected = se2.invert(first.T_root_map[order[0]]) @ first.T_root_map[order]
    assert np.allclose(second.T_root_map, expected, atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.integers(3, 8), st.integers(0, 10_000))
def test_moving_the_frame_of_a_map_moves_its_answer_by_just_that(num_maps, seed):
    graph, coarse, _ = _noisy_graph(seed, num_maps, 0.02)
    T_new_old = se2.make_motion(4.0, -7.0, 2.0)
    last = num_maps - 1
    T = graph.T_i_j.copy()
    T[graph.edges[:, 0] == last] = T_new_old @ T[graph.edges[:, 0] == last]
    T[graph.edges[:, 1] == last] = T[graph.edges[:, 1] == last] @ se2.invert(T_new_old)
    start = coarse.copy()
    start[last] = start[last] @ se2.invert(T_new_old)
    moved = average_motions(MotionGraph(num_maps, graph.edges, T), start, MotionAveragingConfig()).T_root_map
    expected = average_motions(graph, coarse, MotionAveragingConfig()).T_root_map
    assert np.allclose(moved[:last], expected[:last], atol=1e-7)
    assert np.allclose(moved[last] @ T_new_old, expected[last], atol=1e-6)


def test_averaging_beats_the_tree_it_starts_from():
    better = 0
    for seed in range(20):
        graph, coarse, truth = _noisy_graph(seed, 10, 0.03)
        fine = average_motions(graph, coarse, MotionAveragingConfig()).T_root_map
        errors = [np.linalg.norm(se2.log(se2.invert(truth) @ T)) for T in (coarse, fine)]
        better += errors[1] < errors[0]
    assert better >= 18


def test_no_iteration_leaves_the_coarse_motions_as_they_are():
    graph, coarse, _ = _noisy_graph(0, 5, 0.05)
    result = average_motions(graph, coarse, MotionAveragingConfig(max_iterations=0))
    assert (result.T_root_map == coarse).all()
    assert not result.converged


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"averaging\.tolerance must be > 0, got -1"):
        MotionAveragingConfig(tolerance=-1.0)
