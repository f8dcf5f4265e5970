"""Refine a motion between two maps by laying their walls onto each other, in both directions at once.

Trimmed ICP (Eqs. 3-6) is good once overlap is large; here a robust kernel trims instead, its cut-off annealed, with
point-to-line residuals, which slide along walls and converge in a few steps [Censi 2008].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.alignment_kernel import refine_motions, sum_equations
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

_EQUATION_POINTS = 2000
"""Wall points of each map that enter normal equations; more change nothing but the time."""
_INFORMATION_CUTOFF_M = 0.15
"""Walls farther apart say nothing about how certain a motion is."""


@dataclass(frozen=True)
class AlignmentConfig:
    """Settings of the refinement.

    Raises:
        ValueError: a setting is out of its range.
    """

    cutoffs_m: tuple[float, ...] = (0.8, 0.8, 0.6, 0.6, 0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.2)
    """Distance beyond which a point has no say, metres, one for each step; > 0 and falling."""
    num_points: int | None = None
    """Wall points of each map that are compared, at least 10; the rest are skipped evenly. None: all."""
    tolerance: float = 1e-5
    """Steps at the last cut-off end early once shorter than this (metres and radians), > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.cutoffs_m or min(self.cutoffs_m) <= 0.0 or list(self.cutoffs_m) != sorted(self.cutoffs_m)[::-1]:
            raise ValueError(f"cutoffs_m must be > 0 m and falling, got {self.cutoffs_m}")
        if self.num_points is not None and self.num_points < 10:
            raise ValueError(f"num_points must be >= 10, got {self.num_points}")
        if not self.tolerance > 0.0:
            raise ValueError(f"tolerance must be > 0, got {self.tolerance}")


def align_walls(target: WallStructure, source: WallStructure, T_initial: Array, config: AlignmentConfig) -> Array:
    """Refine a motion (see `align_all`).

    Args:
        target: The map that stays.
        source: The map that moves.
        T_initial: (3, 3) ``T_target_source`` between the frames ``map``, metres.
        config: The settings.

    Returns:
        (3, 3) refined ``T_target_source``.
    """
    return align_all(target, source, [T_initial], config)[0]


def align_all(
    target: WallStructure, source: WallStructure, T_initial: Sequence[Array], config: AlignmentConfig
) -> list[Array]:
    """Refine several motions of one pair, each by itself: much faster than one by one.

    Args:
        target: The map that stays.
        source: The map that moves.
        T_initial: (3, 3) motions ``T_target_source`` between the frames ``map``, metres.
        config: The settings.

    Returns:
        (3, 3) refined motions, in the same order.
    """
    if len(T_initial) == 0 or len(target.walls.points) == 0 or len(source.walls.points) == 0:
        return list(T_initial)
    T = refine_motions(
        target.T_field_map @ np.stack(T_initial) @ source.T_map_field,
        target.view(config.num_points),
        source.view(config.num_points),
        config.cutoffs_m,
        config.tolerance,
    )
    return list(target.T_map_field @ T @ source.T_field_map)


def field_motion(target: WallStructure, source: WallStructure, T_target_source: Array) -> Array:
    """The (3, 3) motion between the frames ``field`` of a motion between the frames ``map``."""
    return np.asarray(target.T_field_map @ T_target_source @ source.T_map_field)


def motion_information(
    target: WallStructure, source: WallStructure, T_target_source: Array, metre_variance_m3: float
) -> Array:
    """Information of a motion from the walls that agree under it.

    Args:
        target: The map that stays.
        source: The map that moves.
        T_target_source: (3, 3) motion between the frames ``map``, metres.
        metre_variance_m3: Variance of what one metre of wall says about a shift.

    Returns:
        (3, 3) information of ``v = (x, y, theta)`` in ``T_target_source @ exp(v)``: 1/m^2, 1/(m rad), 1/rad^2.
    """
    T = field_motion(target, source, T_target_source)
    A, _ = _wall_equations(target, source, T, _INFORMATION_CUTOFF_M)
    J = se2.adjoint(T @ se2.invert(source.T_map_field))
    return np.asarray(J.T @ A @ J / metre_variance_m3)


def _wall_equations(target: WallStructure, source: WallStructure, T: Array, cutoff_m: float) -> tuple[Array, Array]:
    """Normal equations ``A v = b`` of both directions, for ``exp(v) @ T`` with T (3, 3) between the frames ``field``.

    Returns:
        (3, 3) A and (3,) b; weights are metres of wall.
    """
    if len(target.walls.points) == 0 or len(source.walls.points) == 0:
        return np.zeros((3, 3)), np.zeros(3)
    views = target.view(_EQUATION_POINTS), source.view(_EQUATION_POINTS)
    A, b = sum_equations(T[None], *views, cutoff_m)
    return A[0], b[0]
