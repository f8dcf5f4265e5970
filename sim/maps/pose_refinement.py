"""The kernel that refines a matched pose: it climbs the likelihood field, held by odometry."""

import math

import numpy as np
from numba import njit

_NUM_ITERATIONS = 20
_SETTLED_CELLS, _SETTLED_RAD = 1e-2, 1e-4
"""A pose is refined until it moves by less than this, or so many times."""
_FLAT = 1e-12
"""Where the square of the field's slope is less, a point tells no direction."""


@njit(cache=True, nogil=True)
def refine_pose(field, points, pose, prior, sigma):  # type: ignore[no-untyped-def] # a kernel
    """Climb the interpolated field, with a Gaussian prior at the prediction, by reweighted least squares.

    A point that lies d from a surface counts weight * exp(-d^2 / (2 sigma^2)): next to the surface it is worth as much
    as a Gaussian residual, far from it (somebody walks by, the surface is new) nothing (Welsch's M-estimator).

    Args:
        field: (H, W) float32.
        points: (P, 2) points in cells, relative to the predicted position, turned by the predicted heading.
        pose: Predicted position x, y in cells; shift x, y and turn to start from.
        prior: As in `sim.maps.likelihood_field.search_pose`.
        sigma: Width of the field, cells.

    Returns:
        Shift x, y (cells) and turn (radians).
    """
    x0, y0, shift_x, shift_y, turn = pose
    for _ in range(_NUM_ITERATIONS):
        H, g = _normal_equations(field, points, (x0, y0, shift_x, shift_y, turn), prior, sigma)
        step = np.linalg.solve(H, g)
        shift_x, shift_y, turn = shift_x + step[0], shift_y + step[1], turn + step[2]
        if abs(step[0]) + abs(step[1]) < _SETTLED_CELLS and abs(step[2]) < _SETTLED_RAD:
            break
    return shift_x, shift_y, turn


@njit(cache=True, nogil=True)
def _normal_equations(field, points, pose, prior, sigma):  # type: ignore[no-untyped-def] # a kernel
    """The reweighted least squares' matrix and gradient: each point's distance, along the field's slope, is linear."""
    x0, y0, shift_x, shift_y, turn = pose
    weight, shift_information, turn_information = prior
    H = np.diag(np.array([shift_information, shift_information, turn_information]))
    g = -np.diag(H) * np.array([shift_x, shift_y, turn])
    slope = np.empty(3)
    cosine, sine = math.cos(turn), math.sin(turn)
    for i in range(len(points)):
        x, y = cosine * points[i, 0] - sine * points[i, 1], sine * points[i, 0] + cosine * points[i, 1]
        value, slope[0], slope[1] = _interpolate(field, x0 + shift_x + x, y0 + shift_y + y)
        steepness = slope[0] * slope[0] + slope[1] * slope[1]
        if steepness < _FLAT:
            continue
        slope[2] = -slope[0] * y + slope[1] * x
        curvature = weight * value / (sigma * sigma * steepness)
        for r in range(3):
            g[r] += weight * slope[r]
            for c in range(r + 1):
                H[r, c] += curvature * slope[r] * slope[c]
    H[0, 1], H[0, 2], H[1, 2] = H[1, 0], H[2, 0], H[2, 1]
    return H, g


@njit(cache=True, nogil=True)
def _interpolate(field, x, y):  # type: ignore[no-untyped-def] # a kernel
    """Value and slopes of the field at a point in cells, bilinear between cell centres; 0 outside."""
    u, v = x - 0.5, y - 0.5
    column, row = math.floor(u), math.floor(v)
    if row < 0 or column < 0 or row >= field.shape[0] - 1 or column >= field.shape[1] - 1:
        return 0.0, 0.0, 0.0
    u, v = u - column, v - row
    f00, f01 = field[row, column], field[row, column + 1]
    f10, f11 = field[row + 1, column], field[row + 1, column + 1]
    value = (1.0 - v) * ((1.0 - u) * f00 + u * f01) + v * ((1.0 - u) * f10 + u * f11)
    return value, (1.0 - v) * (f01 - f00) + v * (f11 - f10), (1.0 - u) * (f10 - f00) + u * (f11 - f01)
