from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from merger.rigid_fit import fit_motion
from merger.rival.growth_kernel import grow_set
from merger.rival.mode_reduction import reduce_modes
from merger.rival.motion_modes import MotionMode, MotionModesConfig, find_modes

_SEEDS = st.integers(0, 2**32 - 1)


def test_two_motions_with_equal_support_give_two_modes_with_their_weights():
    rng = np.random.default_rng(0)
    truth = [se2.make_motion(1.0, 2.0, 0.4), se2.make_motion(-60.0, 0.0, -2.0)]
    source = rng.uniform(-8, 8, size=(40, 2))
    target = np.concatenate([se2.transform_points(T, source) for T in truth])
    candidates = np.stack([np.arange(80), np.tile(np.arange(40), 2)], axis=1)
    modes = reduce_modes(find_modes(target, source, candidates, MotionModesConfig(), rng), 0.9)
    assert sum(mode.weight for mode in modes) == pytest.approx(1.0)
    assert all(first.weight >= second.weight for first, second in pairwise(modes))
    for T in truth:
        best = min(modes[:2], key=lambda mode: np.abs(mode.T_target_source - T).max())
        assert np.abs(best.T_target_source - T).max() < 0.1
        assert 0.3 < best.weight < 0.7
        assert len(best.matches) == 40


@settings(deadline=None, max_examples=30)
@given(_SEEDS)
def test_a_motion_is_found_among_three_times_as_many_false_candidates(seed):
    rng = np.random.default_rng(seed)
    T = se2.make_motion(*rng.uniform(-9, 9, size=2), rng.uniform(-np.pi, np.pi))
    source = rng.uniform(-10, 10, size=(40, 2))
    target = se2.transform_points(T, source)
    true = np.repeat(np.arange(40)[:, None], 2, axis=1)
    candidates = np.concatenate([true, rng.integers(40, size=(120, 2))])
    modes = find_modes(target, source, candidates, MotionModesConfig(), rng)
    best = max(modes, key=lambda mode: len(mode.matches))
    assert len(best.matches) == 40
    assert np.allclose(best.T_target_source, T, atol=1e-6)
    for mode in modes:
        assert np.linalg.eigvalsh(mode.covariance).min() > 0.0
        for column in zip(*mode.matches, strict=True):
            assert len(set(column)) == len(column)


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_candidates_give_no_mode(count):
    points, candidates = np.random.default_rng(0).random((5, 2)), np.zeros((count, 2), dtype=np.intp)
    assert find_modes(points, points, candidates, MotionModesConfig(), np.random.default_rng(0)) == []


def test_several_orientations_of_one_place_support_a_motion_once():
    rng = np.random.default_rng(1)
    source = np.repeat(rng.uniform(-8, 8, size=(10, 2)), 4, axis=0)
    candidates = np.stack([np.arange(40), np.arange(40)], axis=1)
    modes = find_modes(source + 3.0, source, candidates, MotionModesConfig(), rng)
    assert max(len(mode.matches) for mode in modes) == 10


def _grow_slowly(target, source, pair, noise_m, gate):
    """The obvious loop over all free pairs, with the covariances written out."""
    matches = [tuple(row) for row in pair]
    while True:
        i, j = np.array(matches).T
        T = fit_motion(target[i], source[j])
        turned = source @ T[:2, :2].T
        J = np.stack([np.array([[1.0, 0.0, -y], [0.0, 1.0, x]]) for x, y in turned])
        covariance = np.linalg.inv(sum(J[k].T @ J[k] for k in j)) * noise_m**2
        best = (-np.inf, None)
        for b in set(range(len(source))) - set(j):
            S = J[b] @ covariance @ J[b].T + 2.0 * noise_m**2 * np.eye(2)
            for a in set(range(len(target))) - set(i):
                offset = target[a] - turned[b] - T[:2, 2]
                squared = offset @ np.linalg.solve(S, offset)
                if squared <= gate:
                    best = max(best, (-0.5 * (squared + np.log(np.linalg.det(S))), (a, b)))
        if best[1] is None:
            return matches
        matches.append(best[1])


@settings(deadline=None, max_examples=30)
@given(_SEEDS)
def test_a_set_grows_as_in_the_obvious_loop(seed):
    rng = np.random.default_rng(seed)
    T = se2.make_motion(2.0, -1.0, rng.uniform(-np.pi, np.pi))
    source = rng.uniform(-5, 5, size=(14, 2))
    target = np.concatenate(
        [se2.transform_points(T, source[:10]) + rng.normal(0, 0.15, (10, 2)), rng.uniform(-5, 5, (4, 2))]
    )
    order = np.argsort(target[:, 0])
    first = np.array([[int(np.flatnonzero(order == k)[0]), k] for k in (0, 1)])
    quick = grow_set(target[order], source, first, 0.2, 3.0)
    assert [tuple(row) for row in quick.tolist()] == _grow_slowly(target[order], source, first.tolist(), 0.2, 3.0)


def _random_mode(rng):
    spread = rng.normal(size=(3, 3)) * 0.2
    motion = se2.make_motion(*rng.uniform(-2, 2, size=2), rng.uniform(-0.5, 0.5))
    return MotionMode(motion, spread @ spread.T + 1e-3 * np.eye(3), rng.uniform(0.1, 1.0), frozenset({(0, 0)}))


def _moments(modes):
    """Mean and covariance of a whole sum."""
    weights = np.array([mode.weight for mode in modes])
    means = np.array([se2.parameters_of(mode.T_target_source) for mode in modes])
    mean = weights @ means / weights.sum()
    spread = sum(
        w * (m.covariance + np.outer(x - mean, x - mean)) for w, m, x in zip(weights, modes, means, strict=True)
    )
    return mean, spread / weights.sum()


@settings(deadline=None, max_examples=50)
@given(_SEEDS, st.integers(1, 6))
def test_merging_modes_keeps_mean_and_covariance_of_the_whole_sum(seed, count):
    rng = np.random.default_rng(seed)
    modes = [_random_mode(rng) for _ in range(count)]
    merged = reduce_modes(modes, rng.uniform(0.0, 5.0))
    assert sum(mode.weight for mode in merged) == pytest.approx(1.0)
    for before, after in zip(_moments(modes), _moments(merged), strict=True):
        assert np.allclose(before, after, atol=1e-9)


def test_equal_modes_become_one_and_distant_ones_stay_apart():
    mode = _random_mode(np.random.default_rng(0))
    assert len(reduce_modes([mode, mode, mode], 1e-6)) == 1
    far = MotionMode(se2.make_motion(50.0, 0.0, 3.0), mode.covariance, 1.0, mode.matches)
    assert len(reduce_modes([mode, far], 0.9)) == 2
    assert len(reduce_modes([mode, far], np.inf)) == 1
