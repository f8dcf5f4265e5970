"""ICP whose correspondences may be ever less far apart: the refinement of a hypothesis in [Blanco13].

The defaults are those with which MRPT's ``CGridMapAligner`` calls its ``CICP``.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.nearest_edges import EdgeIndex
from merger.rigid_fit import fit_motion

_Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ShrinkingIcpConfig:
    """Settings of ICP and of what it accepts.

    Raises:
        ValueError: a setting is out of its range.
    """

    first_reach_m: float = 0.75
    """Correspondences are at most this far apart at first, > 0 (thresholdDist) ..."""
    last_reach_m: float = 0.05
    """... and at last, > 0 (smallestThresholdDist)."""
    shrink: float = 0.5
    """The reach becomes this times less when the motion rests, in (0, 1) (ALFA)."""
    max_iterations: int = 20
    """After as many the reach shrinks in each, >= 1."""
    stride: int = 5
    """Of the source's points every so many takes part, others each time, >= 1 (corresponding_points_decimation)."""
    tolerance: float = 1e-6
    """The motion rests when it changes by no more, metres and radians, > 0."""
    min_goodness: float = 0.3
    """A motion with a smaller share of matched points is refused, 0..1 (min_ICP_goodness)."""
    max_shift: float = 10.0
    """A motion that ICP moves farther, in standard deviations of its mode, is refused, > 0 (max_ICP_mahadist)."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("first_reach_m", "last_reach_m", "tolerance", "max_shift"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"shrinking_icp.{name} must be > 0, got {getattr(self, name)}")
        for name in ("max_iterations", "stride"):
            if getattr(self, name) < 1:
                raise ValueError(f"shrinking_icp.{name} must be >= 1, got {getattr(self, name)}")
        if not 0.0 < self.shrink < 1.0:
            raise ValueError(f"shrinking_icp.shrink must be in (0, 1), got {self.shrink}")
        if not 0.0 <= self.min_goodness <= 1.0:
            raise ValueError(f"shrinking_icp.min_goodness must be in [0, 1], got {self.min_goodness}")


@dataclass(frozen=True)
class ShrinkingIcpResult:
    """The estimate and what speaks for it."""

    T_target_source: _Array
    """(3, 3) motion, metres."""
    goodness: float
    """Share, 0..1, of the source's points that have a counterpart within the last reach."""
    rmse_m: float
    """Root mean square distance of these; NaN without one."""
    iterations: int
    """Iterations."""


def align_points(
    target: EdgeIndex, points_source: _Array, T_target_source: _Array, config: ShrinkingIcpConfig
) -> ShrinkingIcpResult:
    """Refine a motion by the nearest points within reach; the reach shrinks whenever the motion rests.

    Args:
        target: Edge points of the map that stays.
        points_source: (N, 2) edge points of the map that moves, metres.
        T_target_source: (3, 3) initial motion.
        config: Settings.

    Returns:
        The refined motion and its evidence; the initial motion if it brings no two points within reach.
    """
    reach_m, offset, iterations = config.first_reach_m, 0, 0
    while True:
        points = points_source[offset :: config.stride]
        moved = se2.transform_points(T_target_source, points)
        distances, nearest = map(np.asarray, target.tree.query(moved, distance_upper_bound=reach_m))
        near = np.flatnonzero(np.isfinite(distances))
        if len(near) < 2:
            return ShrinkingIcpResult(T_target_source, 0.0, float("nan"), iterations)
        T_new = fit_motion(target.points_grid[nearest[near]], points[near])
        rests = bool(np.abs(se2.log(se2.invert(T_target_source) @ T_new)).max() <= config.tolerance)
        T_target_source, iterations = T_new, iterations + 1
        if rests or iterations >= config.max_iterations:
            reach_m, offset = reach_m * config.shrink, (offset + 1) % config.stride
        if reach_m < config.last_reach_m:
            rmse_m = float(np.sqrt(np.mean(distances[near] ** 2)))
            return ShrinkingIcpResult(T_target_source, len(near) / len(points), rmse_m, iterations)
