"""The covariance of jointly refined motions: on pulls of which everything is known."""

from itertools import combinations

import numpy as np
import pytest

from merger.robust.joint_covariance import JointCovarianceConfig, estimate_covariance
from merger.robust.joint_equations import Pairs

NUM_MAPS, METRE_M = 5, 0.004
PLAIN = JointCovarianceConfig(unseen=1.0, prior_freedom=1e-6)


class Pulls:
    """All pairs of maps, whose walls pull back by a share of what their number tells, and err by a known spread."""

    def __init__(self, rng: np.random.Generator, pulling: float, edges: list[tuple[int, int]]) -> None:
        """Draw walls, errors, and the motions by which all pulls cancel."""
        count = len(edges)
        self.pairs = Pairs(np.array(edges), rng.uniform(0.5, 2.0, count))
        rows = rng.normal(size=(count, 40, 3)) * (1.0, 1.0, 6.0)
        self.H = np.swapaxes(rows, 1, 2) @ rows
        self.A = pulling * self.H
        lengths_m = 0.5 * (self.H[:, 0, 0] + self.H[:, 1, 1])
        noise = METRE_M**2 * self.H * (1.0 + lengths_m / PLAIN.independent_m)[:, None, None]
        self.errors = np.einsum("eij,ej->ei", np.linalg.cholesky(noise), rng.normal(size=(count, 3)))
        D = np.zeros((count, NUM_MAPS))
        D[np.arange(count), self.pairs.edges[:, 1]] = 1.0
        D[np.arange(count), self.pairs.edges[:, 0]] = -1.0
        D3, weights = np.kron(D[:, 1:], np.eye(3)), np.repeat(self.pairs.weights, 3)
        A3 = np.zeros((3 * count, 3 * count))
        for e in range(count):
            A3[3 * e : 3 * e + 3, 3 * e : 3 * e + 3] = self.A[e]
        normal = D3.T @ (weights[:, None] * A3) @ D3
        self.off = -np.linalg.lstsq(normal, D3.T @ (weights * self.errors.ravel()))[0]
        self.relative = (D3 @ self.off).reshape(-1, 3)

    def equations(self, shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `merger.robust.joint_covariance.Equations`."""
        return self.H, self.errors + np.einsum("eij,ej->ei", self.A, self.relative + shifts)


@pytest.mark.parametrize("pulling", [1.0, 0.1])
def test_errors_are_as_large_as_stated_however_little_the_walls_pull(pulling):
    rng = np.random.default_rng(3)
    squared = []
    for _ in range(150):
        pulls = Pulls(rng, pulling, list(combinations(range(NUM_MAPS), 2)))
        covariance = estimate_covariance(pulls.pairs, pulls.equations, np.full(NUM_MAPS, 0.05), PLAIN)
        for k in range(1, NUM_MAPS):
            off = pulls.off[3 * k - 3 : 3 * k]
            squared.append(off @ np.linalg.solve(covariance[k, k], off))
    assert np.mean(squared) == pytest.approx(3.0, rel=0.2)


def test_what_two_maps_share_makes_their_relative_motion_surer():
    """Maps 3 and 4 hang on each other firmly, and on the rest by one pair."""
    pulls = Pulls(np.random.default_rng(1), 0.3, [(0, 1), (1, 2), (2, 3), (3, 4)])
    C = estimate_covariance(pulls.pairs, pulls.equations, np.full(NUM_MAPS, 0.05), PLAIN)
    apart = C[3, 3] + C[4, 4] - C[3, 4] - C[4, 3]
    assert np.trace(apart) < 0.6 * np.trace(C[4, 4])
    assert np.trace(C[1, 1]) < np.trace(C[2, 2]) < np.trace(C[3, 3]) < np.trace(C[4, 4])


def test_without_cycles_the_prior_alone_tells_how_wrong_pulls_are():
    pulls = Pulls(np.random.default_rng(2), 0.3, [(0, 1), (1, 2), (2, 3), (3, 4)])
    config = JointCovarianceConfig(unseen=2.0, prior_freedom=5.0)
    fine, coarse = (
        estimate_covariance(pulls.pairs, pulls.equations, np.full(NUM_MAPS, cell_m), config) for cell_m in (0.05, 0.1)
    )
    assert coarse == pytest.approx(4.0 * fine)


def test_a_map_that_no_pair_holds_may_lie_anywhere_near():
    pulls = Pulls(np.random.default_rng(2), 0.3, [(0, 1), (1, 2), (0, 2)])
    C = estimate_covariance(pulls.pairs, pulls.equations, np.full(NUM_MAPS, 0.05), PLAIN)
    assert np.sqrt(C[4, 4].diagonal()) == pytest.approx(0.5)
    assert np.sqrt(C[2, 2].diagonal()).max() < 0.1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"probe_cells": 0.0}, "probe_cells must be > 0, got 0"),
        ({"least_slope": -1.0}, "least_slope must be > 0, got -1"),
        ({"independent_m": 0.0}, "independent_m must be > 0, got 0"),
        ({"prior_freedom": 0.0}, "prior_freedom must be > 0, got 0"),
        ({"unseen": 0.5}, "unseen must be >= 1, got 0.5"),
    ],
)
def test_settings_out_of_range_are_refused_with_name_and_value(settings, words):
    with pytest.raises(ValueError, match=words):
        JointCovarianceConfig(**settings)
