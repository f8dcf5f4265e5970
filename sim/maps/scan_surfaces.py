"""Surfaces in a scan: the ends of its beams, their normals, and which neighbours bound one surface."""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from sim.robot_run import LidarSpec

_LINK_STEPS = 6.0
"""Neighbouring ends that lie farther apart than this many steps of a beam at their range belong to two surfaces ..."""
_LINK_EXTRA_M = 0.05
"""... but for this, the noise of two ranges ..."""
_LINK_MAX_M = 0.5
"""... and so do those that lie farther apart than this, a doorway's width."""
_NORMAL_RAD = math.radians(5.0)
"""A normal is fitted to the ends of the beams within this angle to each side ..."""
_NORMAL_REACH_M = 0.4
"""... that lie within this distance."""


def find_surfaces(
    ranges_m: npt.NDArray[np.float32], lidar: LidarSpec, max_range_m: float, motions: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """The surfaces that scans see, without their normals (`fit_normals`).

    Args:
        ranges_m: (K, B) ranges, by REP 117.
        lidar: The lidar.
        max_range_m: Longer ranges are not used.
        motions: (K, 3) of the lidar from beam to beam: `sim.maps.scan_skew.motion_per_beam`.

    Returns:
        (K, B, 4) ends of the beams, frame ``lidar`` at a scan's first beam, metres: NaN where a beam has no usable
        return, and in the two columns of the normals; (K, B) whether an end and the next one bound the same surface.
    """
    directions = np.stack([np.cos(lidar.angles_rad), np.sin(lidar.angles_rad)], axis=-1)
    surfaces = np.full((*ranges_m.shape, 4), np.nan)
    linked = np.zeros(ranges_m.shape, dtype=np.bool_)
    _find(ranges_m, (directions, motions), (abs(lidar.angle_increment_rad), max_range_m), surfaces, linked)
    return surfaces, linked


def fit_normals(
    surfaces: npt.NDArray[np.float64], linked: npt.NDArray[np.bool_], lidar: LidarSpec
) -> npt.NDArray[np.float64]:
    """(K, B, 4) ends and unit normals towards the lidar; NaN normals where an end stands alone.

    Args:
        surfaces: (K, B, 4) ends: `find_surfaces`.
        linked: (K, B) which of them bound the same surface.
        lidar: The lidar.
    """
    fitted = surfaces.copy()
    _fit(fitted, linked, max(round(_NORMAL_RAD / abs(lidar.angle_increment_rad)), 1))
    return fitted


@njit(cache=True, nogil=True)
def _find(ranges_m, sweep, limits, surfaces, linked):  # type: ignore[no-untyped-def] # a kernel
    directions, motions = sweep
    step_rad, max_range_m = limits
    num_beams = len(directions)
    for s in range(len(ranges_m)):
        points = surfaces[s]
        _place_ends(ranges_m[s], (directions, motions[s]), max_range_m, points)
        for b in range(num_beams - 1):
            gap_m = math.hypot(points[b + 1, 0] - points[b, 0], points[b + 1, 1] - points[b, 1])
            widest_m = _LINK_STEPS * step_rad * min(ranges_m[s, b], ranges_m[s, b + 1]) + _LINK_EXTRA_M
            linked[s, b] = gap_m <= min(widest_m, _LINK_MAX_M)


@njit(cache=True, nogil=True)
def _place_ends(ranges_m, sweep, max_range_m, points):  # type: ignore[no-untyped-def] # a kernel
    """The ends of a scan's beams in the frame of its first one, while the lidar moves on evenly."""
    directions, motion = sweep
    turn_x, turn_y = math.cos(motion[2]), math.sin(motion[2])
    heading_x, heading_y = 1.0, 0.0
    for b in range(len(directions)):
        if 0.0 < ranges_m[b] <= max_range_m:
            x = heading_x * directions[b, 0] - heading_y * directions[b, 1]
            y = heading_y * directions[b, 0] + heading_x * directions[b, 1]
            points[b, 0], points[b, 1] = b * motion[0] + ranges_m[b] * x, b * motion[1] + ranges_m[b] * y
        heading_x, heading_y = heading_x * turn_x - heading_y * turn_y, heading_y * turn_x + heading_x * turn_y


@njit(cache=True, nogil=True)
def _fit(surfaces, linked, num_beams):  # type: ignore[no-untyped-def] # a kernel
    for s in range(len(surfaces)):
        for b in range(surfaces.shape[1]):
            _fit_normal(surfaces[s], linked[s], b, num_beams)


@njit(cache=True, nogil=True)
def _fit_normal(points, linked, b, num_beams):  # type: ignore[no-untyped-def] # a kernel
    """Unit normal of the line through an end and its neighbours on the same surface, towards the lidar."""
    count, sx, sy, sxx, sxy, syy = 1, 0.0, 0.0, 0.0, 0.0, 0.0
    for side in (-1, 1):
        k = b
        for _ in range(num_beams):
            k += side
            if k < 0 or k >= len(points) or not linked[min(k, k - side)]:
                break
            x, y = points[k, 0] - points[b, 0], points[k, 1] - points[b, 1]
            if x * x + y * y > _NORMAL_REACH_M * _NORMAL_REACH_M:
                break
            count, sx, sy = count + 1, sx + x, sy + y
            sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
    if count == 1:
        return
    cxx, cxy, cyy = sxx - sx * sx / count, sxy - sx * sy / count, syy - sy * sy / count
    along = 0.5 * math.atan2(2.0 * cxy, cxx - cyy)
    nx, ny = -math.sin(along), math.cos(along)
    away = nx * points[b, 0] + ny * points[b, 1] > 0.0
    points[b, 2], points[b, 3] = (-nx, -ny) if away else (nx, ny)
