import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.nearest_edges import find_nearest, find_nearest_quickly, index_edges
from merger.pairwise import align_smaller
from merger.rigid_fit import fit_motion
from merger.trimmed_icp import TrimmedIcpConfig, align, choose_overlap

_CELL_M = 0.05


def _scatter(seed, count=400):
    """Irregular points on the walls of a few rooms: on a lattice, a wall would fit itself one cell farther on."""
    rng = np.random.default_rng(seed)
    ends = [
        ((0, 0), (12, 0)),
        ((0, 4), (12, 4.4)),
        ((0, 9), (12, 9)),
        ((0, 0), (0, 9)),
        ((5, 0), (5.5, 9)),
        ((12, 0), (12, 9)),
    ]
    start, stop = (np.array(side, dtype=float) for side in zip(*ends, strict=True))
    wall = rng.integers(len(ends), size=count)
    on_walls = start[wall] + rng.random((count, 1)) * (stop - start)[wall]
    return np.concatenate([on_walls, rng.uniform(0.5, 8.5, size=(count // 5, 2))])


_starts = st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.003, 0.003)).map(np.array)
_poses = st.tuples(st.floats(-30, 30), st.floats(-30, 30), st.floats(-np.pi, np.pi)).map(lambda p: se2.make_motion(*p))


@settings(max_examples=12, deadline=None)
@given(_poses, _starts)
def test_exact_data_gives_the_exact_motion_from_perturbed_starts(T_target_source, start):
    points = _scatter(0)
    source = se2.transform_points(se2.invert(T_target_source), points)
    result = align(index_edges(points, _CELL_M), source, T_target_source @ se2.exp(start), TrimmedIcpConfig())
    assert np.allclose(result.T_target_source, T_target_source, atol=1e-9)
    assert result.overlap == 1.0
    assert result.rmse_m < 1e-9
    assert result.converged


@settings(max_examples=8, deadline=None)
@given(st.floats(0.45, 0.9), _starts)
def test_exact_data_of_a_part_gives_the_exact_motion_and_the_true_overlap(share, start):
    points = _scatter(1)
    points = points[np.argsort(points[:, 0], kind="stable")]
    shared = points[: round(share * len(points))]
    alone = points[len(shared) :] + np.array([40.0, 0.0])
    source = np.concatenate([shared, alone])
    result = align(index_edges(points, _CELL_M), source, se2.exp(start), TrimmedIcpConfig())
    assert np.allclose(result.T_target_source, np.eye(3), atol=1e-9)
    assert result.overlap == pytest.approx(len(shared) / len(points), abs=1e-12)


@settings(max_examples=8, deadline=None)
@given(_starts)
def test_aligning_b_to_a_inverts_aligning_a_to_b(start):
    points_a, points_b = _scatter(2)[:350], _scatter(2)[100:]
    a, b = index_edges(points_a, _CELL_M), index_edges(points_b, _CELL_M)
    shift = se2.exp(0.5 * start)
    forward = align_smaller(a, b, shift, TrimmedIcpConfig())
    backward = align_smaller(b, a, se2.invert(shift), TrimmedIcpConfig())
    assert np.allclose(forward.T_target_source @ backward.T_target_source, np.eye(3), atol=1e-9)
    assert forward.overlap == backward.overlap
    moved = se2.chain_information(forward.information, backward.T_target_source)
    assert np.allclose(backward.information, moved, rtol=1e-6, atol=1e-3 * np.abs(moved).max())


def test_a_source_far_beyond_the_table_is_aligned_as_far_as_it_overlaps():
    points = _scatter(3)
    source = np.concatenate([points, points[:80] + np.array([500.0, -300.0])])
    result = align(index_edges(points, _CELL_M), source, se2.make_motion(0.05, 0.0, 0.0), TrimmedIcpConfig())
    assert np.allclose(result.T_target_source, np.eye(3), atol=1e-9)
    assert result.overlap == pytest.approx(len(points) / len(source))


def test_without_trimming_outliers_pull_the_motion_away():
    points = _scatter(4)
    source = np.concatenate([points, points[:100] + np.array([0.0, 6.0])])
    start = se2.make_motion(0.05, 0.05, 0.0)
    trimmed = align(index_edges(points, _CELL_M), source, start, TrimmedIcpConfig())
    plain = align(index_edges(points, _CELL_M), source, start, TrimmedIcpConfig(min_overlap=1.0))
    assert np.hypot(*trimmed.T_target_source[:2, 2]) < 1e-9
    assert np.hypot(*plain.T_target_source[:2, 2]) > 0.01


@given(
    st.lists(st.floats(0.0, 4.0), min_size=2, max_size=40),
    st.floats(0.0, 3.0),
    st.floats(0.05, 1.0),
)
def test_the_overlap_minimises_the_printed_objective(squared, exponent, least):
    squared = np.sort(np.array(squared))
    config = TrimmedIcpConfig(trim_exponent=exponent, min_overlap=least)
    count = choose_overlap(squared, config)
    total = len(squared)
    smallest = min(total, max(2, int(np.ceil(least * total))))
    cost = {n: squared[:n].sum() / (n * (n / total) ** (1 + exponent)) for n in range(smallest, total + 1)}
    assert count in cost
    assert cost[count] <= min(cost.values()) * (1 + 1e-9) + 1e-12


def test_nearest_points_are_those_of_brute_force_near_the_edges():
    rng = np.random.default_rng(5)
    points = _scatter(5)
    index = index_edges(points, _CELL_M)
    queries = points[rng.integers(len(points), size=400)] + rng.uniform(-0.15, 0.15, size=(400, 2))
    distances = np.linalg.norm(queries[:, None] - points[None], axis=2)
    exact = np.linalg.norm(queries - points[find_nearest(index, queries)], axis=1)
    quick = np.linalg.norm(queries - points[find_nearest_quickly(index, queries)], axis=1)
    near = distances.min(axis=1) < 2 * _CELL_M
    assert np.allclose(exact[near], distances.min(axis=1)[near], atol=1e-12)
    assert (quick <= distances.min(axis=1) + 1.5 * _CELL_M).all()


@given(_poses, st.integers(2, 30), st.integers(0, 1000))
def test_the_rigid_fit_of_exactly_paired_points_is_exact(T_target_source, count, seed):
    source = np.random.default_rng(seed).uniform(-5, 5, size=(count, 2))
    fitted = fit_motion(se2.transform_points(T_target_source, source), source)
    assert np.allclose(fitted, T_target_source, atol=1e-6)


def test_the_rigid_fit_is_the_least_squares_one():
    rng = np.random.default_rng(6)
    source, target = rng.normal(size=(2, 40, 2))
    fitted = fit_motion(target, source)

    def cost(T):
        return ((se2.transform_points(T, source) - target) ** 2).sum()

    for v in 1e-3 * np.vstack([np.eye(3), -np.eye(3)]):
        assert cost(fitted) <= cost(fitted @ se2.exp(v))


@pytest.mark.parametrize(
    ("field", "value"),
    [("trim_exponent", -1.0), ("min_overlap", 0.0), ("min_overlap", 1.5), ("max_iterations", 0), ("tolerance_m", 0.0)],
)
def test_settings_out_of_range_are_refused_by_name_and_value(field, value):
    with pytest.raises(ValueError, match=rf"icp\.{field} must be .*{value}"):
        TrimmedIcpConfig(**{field: value})
