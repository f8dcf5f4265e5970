"""TrICP: the overlap of two point sets and the motion between them, estimated together (Sec. 2.2, Eqs. 3-6)."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.nearest_edges import EdgeIndex, find_nearest, find_nearest_quickly
from merger.rigid_fit import fit_motion

_Array = npt.NDArray[np.float64]
_Search = Callable[[EdgeIndex, _Array], npt.NDArray[np.int32]]

_ROUNDING_M2 = 1e-18
"""Added to squared distances, so that rounding does not choose the overlap of exact data: a nanometre, squared."""


@dataclass(frozen=True)
class TrimmedIcpConfig:
    """Settings of TrICP.

    Raises:
        ValueError: a setting is out of its range.
    """

    trim_exponent: float = 2.0
    """The preset lambda of Eq. 3, >= 0; larger values prefer a larger overlap."""
    min_overlap: float = 0.1
    """Smallest overlap xi that is considered, in (0, 1]; 1 is ICP without trimming."""
    max_quick_iterations: int = 60
    """Iterations with tabulated neighbours, >= 0."""
    max_iterations: int = 20
    """Iterations with exact neighbours that follow, >= 1."""
    max_quick_points: int = 2000
    """About as many source points are used in the tabulated iterations, taken evenly, >= 2."""
    quick_tolerance_m: float = 1e-3
    """The tabulated iterations end when no point moves farther, > 0."""
    tolerance_m: float = 5e-4
    """The exact iterations have converged when no point moves farther, > 0."""
    noise_floor_m: float = 0.01
    """Least noise of a coordinate that the information assumes, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.trim_exponent < 0.0:
            raise ValueError(f"icp.trim_exponent must be >= 0, got {self.trim_exponent}")
        if not 0.0 < self.min_overlap <= 1.0:
            raise ValueError(f"icp.min_overlap must be in (0, 1], got {self.min_overlap}")
        if self.max_quick_iterations < 0:
            raise ValueError(f"icp.max_quick_iterations must be >= 0, got {self.max_quick_iterations}")
        if self.max_quick_points < 2:
            raise ValueError(f"icp.max_quick_points must be >= 2, got {self.max_quick_points}")
        if self.max_iterations < 1:
            raise ValueError(f"icp.max_iterations must be >= 1, got {self.max_iterations}")
        for name in ("quick_tolerance_m", "tolerance_m", "noise_floor_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"icp.{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class TrimmedIcpResult:
    """The estimate and what speaks for it."""

    T_target_source: _Array
    """(3, 3) motion, metres."""
    overlap: float
    """The estimated xi: share of the source points that have a counterpart, 0..1."""
    rmse_m: float
    """Root mean square distance of the trimmed correspondences."""
    num_points: int
    """Number of the trimmed correspondences."""
    iterations: int
    """Iterations of both kinds."""
    converged: bool
    """Whether the exact iterations came to rest."""
    information: _Array
    """(3, 3) information of ``v`` in ``T_target_source @ exp(v)``, as if the points' noise were independent."""


def align(
    target: EdgeIndex, points_source: _Array, T_target_source: _Array, config: TrimmedIcpConfig
) -> TrimmedIcpResult:
    """Refine a motion: correspondences (Eq. 4), overlap (Eq. 5), motion (Eq. 6), until it rests.

    Note: The paper searches exact neighbours of all points throughout. Here a table and a part of the points serve
    until the motion rests, and exact neighbours of all points finish: the same fixed point in a fraction of the time.

    Args:
        target: Edge points of the map that stays.
        points_source: (N, 2) edge points of the map that moves, metres, N >= 2.
        T_target_source: (3, 3) initial motion.
        config: Settings.

    Returns:
        The refined motion and its evidence.
    """
    center = points_source.mean(axis=0, keepdims=True)
    radius_m = float(np.hypot(*(points_source - center).T).max())
    total, moved_m = 0, np.inf
    some = np.ascontiguousarray(points_source[:: math.ceil(len(points_source) / config.max_quick_points)])
    for search, points, limit, tolerance_m in (
        (find_nearest_quickly, some, config.max_quick_iterations, config.quick_tolerance_m),
        (find_nearest, points_source, config.max_iterations, config.tolerance_m),
    ):
        for _ in range(limit):
            T_new = _iterate(target, points, T_target_source, search, config)
            moved_m = _displacement(T_new, T_target_source, center, radius_m)
            T_target_source, total = T_new, total + 1
            if moved_m < tolerance_m:
                break
    result = _evaluate(target, points_source, T_target_source, config)
    return replace(result, iterations=total, converged=moved_m < config.tolerance_m)


def choose_overlap(squared: _Array, config: TrimmedIcpConfig) -> int:
    """Number of the nearest correspondences that belong to the overlap (Eq. 5).

    Args:
        squared: (N,) squared distances in ascending order.
        config: Settings.

    Returns:
        The n that minimises ``(sum of the n smallest / n) / (n / N)^(1 + lambda)``; of equal ones the largest.
    """
    divisor = _make_divisor(len(squared), config.min_overlap, config.trim_exponent)
    smallest = len(squared) - len(divisor) + 1
    cost = np.cumsum(squared + _ROUNDING_M2)[smallest - 1 :] / divisor
    return len(squared) - int(np.argmin(cost[::-1]))


@lru_cache(maxsize=256)
def _make_divisor(num_points: int, min_overlap: float, trim_exponent: float) -> _Array:
    """``n * (n / N)^(1 + lambda)`` for each n from the smallest overlap to N; kept, because powers are slow."""
    smallest = min(num_points, max(2, int(np.ceil(min_overlap * num_points))))
    count = np.arange(smallest, num_points + 1)
    return np.asarray(count * (count / num_points) ** (1.0 + trim_exponent))


def _iterate(
    target: EdgeIndex,
    points_source: _Array,
    T_target_source: _Array,
    search: _Search,
    config: TrimmedIcpConfig,
) -> _Array:
    paired, kept, _ = _correspond(target, points_source, T_target_source, search, config)
    return fit_motion(paired[kept], points_source[kept])  # Eq. (6).


def _correspond(
    target: EdgeIndex, points_source: _Array, T_target_source: _Array, search: _Search, config: TrimmedIcpConfig
) -> tuple[_Array, npt.NDArray[np.intp], _Array]:
    """(N, 2) nearest target points (Eq. 4), the indices that belong to the overlap (Eq. 5), squared distances."""
    moved = se2.transform_points(T_target_source, points_source)
    paired = target.points_grid[search(target, moved)]
    offset = moved - paired
    squared = np.einsum("ij,ij->i", offset, offset)
    ascending = np.sort(squared)
    limit = ascending[choose_overlap(ascending, config) - 1]
    return paired, np.flatnonzero(squared <= limit), squared


def _displacement(T_new: _Array, T_old: _Array, center: _Array, radius_m: float) -> float:
    """A bound, metres, of how far any point within a radius of the (1, 2) centre moved between two motions."""
    shift = se2.transform_points(T_new, center) - se2.transform_points(T_old, center)
    turn = abs(float(se2.wrap_angle(se2.angle_of(T_new) - se2.angle_of(T_old))))
    return float(np.hypot(*shift[0])) + turn * radius_m


def _evaluate(
    target: EdgeIndex, points_source: _Array, T_target_source: _Array, config: TrimmedIcpConfig
) -> TrimmedIcpResult:
    """What speaks for a motion: Eqs. 4 and 5 once more, without a further step."""
    _, kept, squared = _correspond(target, points_source, T_target_source, find_nearest, config)
    mean_square = float(squared[kept].mean())
    information = _hessian(points_source[kept]) / max(mean_square / 2.0, config.noise_floor_m**2)
    overlap = len(kept) / len(points_source)
    return TrimmedIcpResult(T_target_source, overlap, float(np.sqrt(mean_square)), len(kept), 0, False, information)


def _hessian(points_source: _Array) -> _Array:
    """Sum of J^T J with J = [I, (-y, x)], the derivative of a moved point by v."""
    x, y = points_source[:, 0], points_source[:, 1]
    count = float(len(points_source))
    sx, sy = float(x.sum()), float(y.sum())
    return np.array([[count, 0.0, -sy], [0.0, count, sx], [-sy, sx, float((x * x + y * y).sum())]])
