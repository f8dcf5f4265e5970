"""The directions of a map's walls: which rotations can lay two maps' walls parallel or square."""

import numpy as np
import numpy.typing as npt

from merger.robust.wall_kernels import Walls

Array = npt.NDArray[np.float64]
Coefficients = npt.NDArray[np.complex128]

_HARMONICS = np.arange(17)
"""Of the directions of a map's walls, which count alike after a quarter turn: most walls meet at right angles."""
_PARALLEL_RAD = np.radians(3.0)
"""Walls that differ by about this are parallel."""


def describe_directions(walls: Walls) -> Coefficients:
    """(17,) Fourier coefficients of wall length by direction, folded to a quarter turn; what is no line has none."""
    nx, ny = walls.normals.T
    first = np.exp(-4j * np.arctan2(ny, nx))
    powers = np.cumprod(np.vstack([np.ones_like(first), np.tile(first, (len(_HARMONICS) - 1, 1))]), axis=0)
    return np.asarray(np.einsum("ij,j", powers, walls.lengths_m * walls.linearity**2))


def are_parallel(
    target: Coefficients, source: Coefficients, angles_rad: Array, min_parallel: float
) -> npt.NDArray[np.bool_]:
    """Tell which rotations lay enough walls of two maps parallel or square to be tried.

    All walls of one building share its few directions, so the true rotation lays many parallel, whatever the overlap.
    Those at right angles count, too: two maps that look along two corridors share walls that are few in one of them.

    Args:
        target: Directions of the map that stays (see `describe_directions`).
        source: Directions of the map that moves.
        angles_rad: (R,) rotations; the opposite ones are alike.
        min_parallel: Share of the best rotation's parallel walls, 0 to 1.

    Returns:
        (R,) whether to try each.
    """
    weight = np.where(_HARMONICS > 0, 2.0, 1.0) * np.exp(-0.5 * (4.0 * _HARMONICS * _PARALLEL_RAD) ** 2)
    series = weight * target * np.conj(source)
    parallel = (np.exp(4j * np.outer(angles_rad, _HARMONICS)) @ series).real
    return np.asarray(parallel >= min_parallel * parallel.max())
