"""How certain jointly refined motions are: a sandwich of how walls pull back and of how much their pulls disagree.

Walls pull back much less than their number tells: whoever moves a map a little finds that rough walls meet other walls
instead, and that as many leave the kernel as enter it. So the pull is probed, by small shifts of each pair. How much
pulls are wrong is learnt from cycles of pairs, which contradict each other. Source: the covariance of M-estimators
[Huber 1967], with the scale of the pulls from generalised least squares.

Note:
    ``prior_cells`` and ``unseen`` are one choice for all data. By kind of set (15 kinds: simulated with noise of 0 to
    0.08 m and mapped with true or matched poses, and three real logs) the mean squared error over its covariance is
    0.35 to 3.0 times what it should be. Above 2 are noisy maps that are bent alike in all their pairs, which no cycle
    shows. Of buildings that took no part: 0.9 at cells of 0.1 m, 1.5 at 0.025 m.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger.robust.averaging import solve_blocks
from merger.robust.joint_equations import Pairs

Array = npt.NDArray[np.float64]
Equations = Callable[[Array], tuple[Array, Array]]
"""(E, 3, 3) H and (E, 3) g, not weighted, of pairs of which (E, 3) steps ``exp(v) @ T_root_field`` move the second."""

_ANCHOR = 1e-6
"""How firmly each map is held where it is, metres of wall: so a map that no pair holds has a covariance, too."""
_UNHELD = 0.25
"""Its variance, m^2 and rad^2."""
_LEAST_RADIUS_M = 0.1
"""Walls that lie together more closely turn as if they did not."""


@dataclass(frozen=True)
class JointCovarianceConfig:
    """What is known of pulls beforehand.

    Raises:
        ValueError: a setting is out of its range.
    """

    probe_cells: float = 0.2
    """How far pairs are moved to feel how they pull back, cells, > 0."""
    least_slope: float = 0.02
    """Walls pull back by at least this share of what rigid, smooth walls would, > 0."""
    independent_m: float = 2.0
    """The errors of two maps' walls are not independent: many metres of wall say hardly more than so many; > 0."""
    prior_cells: float = 0.034
    """How far a metre of wall pulls aside of the truth, beforehand, cells; > 0."""
    prior_freedom: float = 9.0
    """Degrees of freedom that this counts as beside those of the cycles, > 0."""
    unseen: float = 1.8
    """Variance over the part of it that cycles show: what is wrong alike in all of a map's pairs closes them; >= 1."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("probe_cells", "least_slope", "independent_m", "prior_cells", "prior_freedom"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if not self.unseen >= 1.0:
            raise ValueError(f"unseen must be >= 1, got {self.unseen}")


def estimate_covariance(pairs: Pairs, equations: Equations, cells_m: Array, config: JointCovarianceConfig) -> Array:
    """Estimate the joint covariance of the steps v of ``exp(v) @ T_root_field`` that would be right.

    Args:
        pairs: E pairs that overlap.
        equations: What they say about the refined motions.
        cells_m: (N,) cell sides of the maps, metres.
        config: The settings.

    Returns:
        (N, N, 3, 3) covariances; those with the first map, which stays, are zero.
    """
    count = len(cells_m)
    H, g = equations(np.zeros((len(pairs.edges), 3)))
    slopes = _probe(H, equations, config.probe_cells * cells_m[pairs.edges].max(axis=1), config)
    lengths_m = 0.5 * (H[:, 0, 0] + H[:, 1, 1])
    noise = H * (1.0 + lengths_m / config.independent_m)[:, None, None]
    squares, freedom = _cycle_squares(pairs, slopes, noise, g, count)
    prior = config.prior_freedom * (config.prior_cells * float(np.mean(cells_m))) ** 2
    noise *= config.unseen * (squares + prior) / (freedom + config.prior_freedom)
    weights = pairs.weights[:, None, None]
    anchor = _ANCHOR * np.eye(3 * count - 3)
    inverse = np.linalg.inv(_assemble(pairs, weights * slopes, count) + anchor)
    middle = _assemble(pairs, weights**2 * noise, count) + _UNHELD * anchor**2
    spread = (inverse @ middle @ inverse).reshape(count - 1, 3, count - 1, 3)
    covariance = np.zeros((count, count, 3, 3))
    covariance[1:, 1:] = spread.transpose(0, 2, 1, 3)
    return covariance


def _probe(H: Array, equations: Equations, shift_m: Array, config: JointCovarianceConfig) -> Array:
    """(E, 3, 3) symmetric positive definite derivatives of the pulls, by central differences over (E,) shifts."""
    twists = _twists(H)
    rows = []
    for axis in range(3):
        steps = twists[:, :, axis] * shift_m[:, None]
        rows.append((equations(steps)[1] - equations(-steps)[1]) / (2.0 * shift_m[:, None]))
    slopes = np.swapaxes(twists, 1, 2) @ np.stack(rows, axis=2)
    stiff = np.swapaxes(twists, 1, 2) @ H @ twists
    stiff += 1e-6 * np.trace(stiff, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    root = np.linalg.cholesky(stiff)
    unroot = np.linalg.inv(root)
    shares, axes = np.linalg.eigh(unroot @ (0.5 * (slopes + np.swapaxes(slopes, 1, 2))) @ np.swapaxes(unroot, 1, 2))
    back = np.linalg.inv(np.swapaxes(twists, 1, 2)) @ root @ axes
    return np.asarray((back * np.maximum(shares, config.least_slope)[:, None, :]) @ np.swapaxes(back, 1, 2))


def _twists(H: Array) -> Array:
    """(E, 3, 3) columns that move each pair's walls by a metre: along x, along y, and about their middle."""
    twists = np.tile(np.eye(3), (len(H), 1, 1))
    twists[:, :2, 2:] = -np.linalg.solve(H[:, :2, :2], H[:, :2, 2:])
    turn = twists[:, :, 2]
    squared_m2 = np.einsum("ei,eij,ej->e", turn, H, turn) / (0.5 * (H[:, 0, 0] + H[:, 1, 1]))
    twists[:, :, 2] /= np.sqrt(np.maximum(squared_m2, _LEAST_RADIUS_M**2))[:, None]
    return twists


def _cycle_squares(pairs: Pairs, slopes: Array, noise: Array, g: Array, count: int) -> tuple[float, float]:
    """Sum of squares, over their (E, 3, 3) ``noise``, by which pairs contradict each other, and degrees of freedom."""
    information = slopes @ np.linalg.solve(noise, slopes)
    wanted = -np.linalg.solve(slopes, g[:, :, None])
    i, j = pairs.edges.T
    steps = solve_blocks(pairs.edges, information, -(information @ wanted)[:, :, 0], count)
    rest = (steps[j] - steps[i])[:, :, None] - wanted
    squares = float((np.swapaxes(rest, 1, 2) @ information @ rest).sum())
    return squares, 3.0 * max(len(pairs.edges) - len(np.unique(pairs.edges)) + 1, 0)


def _assemble(pairs: Pairs, blocks: Array, count: int) -> Array:
    """(3 N - 3, 3 N - 3) sum over all pairs of (E, 3, 3) blocks of the second map's steps less the first one's."""
    normal = np.zeros((count, count, 3, 3))
    for (i, j), block in zip(pairs.edges.tolist(), blocks, strict=True):
        normal[i, i] += block
        normal[j, j] += block
        normal[i, j] -= block
        normal[j, i] -= block
    return normal.transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)[3:, 3:]
