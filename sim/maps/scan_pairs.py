"""The kernel of joint scan alignment: the point-to-line equations between two overlapping scans.

Points of one scan are put to the nearest of the few beams of the other that look in the same direction, which needs
no search tree (projective association: Diosi and Kleeman, "Fast laser scan matching using polar coordinates", 2007).
"""

import math

import numpy as np
from numba import njit

_NEIGHBOURS, _NEIGHBOUR_RAD = 5, math.radians(1.0)
"""The nearest end is looked for among so many beams to each side, so far apart (or farther: neighbours)."""
_POINTS = 90
"""About so many ends of a scan are put to another one's."""
_SAME_SIDE_COS = 0.7
"""Normals of one surface, seen by two scans, agree at least so much."""


@njit(cache=True, nogil=True)
def pair_equations(scans, T_map_lidar, pairs, angles, reach):  # type: ignore[no-untyped-def] # a kernel
    """Normal equations of the pairs' residuals n . (T_i p - T_j q), Geman-McClure weighted.

    Args:
        scans: (K, B, 4) ends of the beams and their surfaces' unit normals towards the lidar, frame ``lidar``, metres;
            NaN where there is none.
        T_map_lidar: (K, 3, 3) poses.
        pairs: (M, 2) indices i, j: points of i are put to surfaces of j.
        angles: First beam's angle, step (radians).
        reach: Largest distance of a correspondence; standard deviation of its residual, metres.

    Returns:
        (M, 3, 3) and (M, 3): A = sum w a a^T and g = sum w a r with a = dr/dv for ``T_i <- exp(v) T_i`` (which is
        minus that of ``T_j``); (M,) number of correspondences.
    """
    H, g = np.zeros((len(pairs), 3, 3)), np.zeros((len(pairs), 3))
    counts = np.zeros(len(pairs), dtype=np.int64)
    for m in range(len(pairs)):
        i, j = pairs[m]
        counts[m] = _add_pair(scans[i], scans[j], T_map_lidar[i], T_map_lidar[j], (angles, reach, H[m], g[m]))
    return H, g, counts


@njit(cache=True, nogil=True)
def _add_pair(scan_i, scan_j, T_i, T_j, rest):  # type: ignore[no-untyped-def] # a kernel
    angles, reach, H, g = rest
    max_distance_m, sigma_m = reach
    count = 0
    a = np.empty(3)
    stride = max(len(scan_i) // _POINTS, 1)
    for b in range(len(scan_i) % stride, len(scan_i), stride):
        if not scan_i[b, 2] <= 1.0:
            continue
        x = T_i[0, 0] * scan_i[b, 0] + T_i[0, 1] * scan_i[b, 1] + T_i[0, 2]
        y = T_i[1, 0] * scan_i[b, 0] + T_i[1, 1] * scan_i[b, 1] + T_i[1, 2]
        off_x, off_y = x - T_j[0, 2], y - T_j[1, 2]
        u, v = T_j[0, 0] * off_x + T_j[1, 0] * off_y, T_j[0, 1] * off_x + T_j[1, 1] * off_y
        k = _nearest_beam(scan_j, u, v, angles, max_distance_m)
        if k < 0:
            continue
        nx = T_j[0, 0] * scan_j[k, 2] + T_j[0, 1] * scan_j[k, 3]
        ny = T_j[1, 0] * scan_j[k, 2] + T_j[1, 1] * scan_j[k, 3]
        own_x = T_i[0, 0] * scan_i[b, 2] + T_i[0, 1] * scan_i[b, 3]
        own_y = T_i[1, 0] * scan_i[b, 2] + T_i[1, 1] * scan_i[b, 3]
        if nx * own_x + ny * own_y < _SAME_SIDE_COS:
            continue
        residual = scan_j[k, 2] * (u - scan_j[k, 0]) + scan_j[k, 3] * (v - scan_j[k, 1])
        ratio = residual / max(sigma_m, 0.3 * max_distance_m)
        weight = 1.0 / (sigma_m * (1.0 + ratio * ratio)) ** 2
        a[0], a[1], a[2] = nx, ny, ny * x - nx * y
        for r in range(3):
            g[r] += weight * a[r] * residual
            for c in range(r + 1):
                H[r, c] += weight * a[r] * a[c]
        count += 1
    H[0, 1], H[0, 2], H[1, 2] = H[1, 0], H[2, 0], H[2, 1]
    return count * stride


@njit(cache=True, nogil=True)
def _nearest_beam(scan, x, y, angles, max_distance_m):  # type: ignore[no-untyped-def] # a kernel
    """The beam, of those that look towards a point in frame ``lidar``, whose end is nearest to it; -1: none is near."""
    turn = math.atan2(y, x) - angles[0]
    if turn * angles[1] < -0.5 * angles[1] * angles[1]:
        turn += math.copysign(2.0 * math.pi, angles[1])
    towards = int(turn / angles[1] + 0.5)
    step = max(int(_NEIGHBOUR_RAD / abs(angles[1]) + 0.5), 1)
    best, found = max_distance_m * max_distance_m, -1
    for beam in range(towards - _NEIGHBOURS * step, towards + _NEIGHBOURS * step + 1, step):
        if beam < 0 or beam >= len(scan):
            continue
        off_x, off_y = x - scan[beam, 0], y - scan[beam, 1]
        distance = off_x * off_x + off_y * off_y
        if distance < best and scan[beam, 2] <= 1.0:
            best, found = distance, beam
    return found
