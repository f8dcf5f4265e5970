"""What the cells about a wall cell tell of it: the wall's direction, how much it is a line, and its free side."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_CELLS_AT_ONCE = 2_000_000
"""So many cells of windows are summed up at once: few enough for the memory, many enough for the time."""


class Surroundings(NamedTuple):
    """What the square windows about P wall cells hold."""

    num_cells: Array
    """(P,) wall cells, its own included."""
    normals: Array
    """(P, 2) unit normals, sign arbitrary."""
    linearity: Array
    """(P,) 0..1: how much the wall cells are a line; 0 for fewer than three."""
    facing: Array
    """(P, 2) mean offset of the free cells, 1 long if half of the window is free."""


def describe_surroundings(
    surface: Mask, free: Mask, places: tuple[Numbers, Numbers], radius_cells: float
) -> Surroundings:
    """Describe wall cells by the cells about them.

    Args:
        surface: (H, W) the wall cells.
        free: (H, W) the free cells.
        places: (P,) rows and (P,) columns of the wall cells, none at the border.
        radius_cells: Half side of the windows, cells; at least 1 is taken.
    """
    half = max(1, round(radius_cells))
    moments = sum_windows(surface, places, half, ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)))
    half_plane = (2 * half + 1) * half * (half + 1) / 2.0
    facing = sum_windows(free, places, half, ((1, 0), (0, 1))).T / half_plane
    return Surroundings(moments[0], *_directions(moments), facing)


def sum_windows(mask: Mask, places: tuple[Numbers, Numbers], half: int, powers: tuple[tuple[int, int], ...]) -> Array:
    """Sum ``dx ** p * dy ** q`` over the cells of square windows where a mask holds.

    Args:
        mask: (H, W) the mask; false outside.
        places: (P,) rows and (P,) columns of the windows' middles.
        half: Half side of the windows, cells.
        powers: The exponents (p, q).

    Returns:
        (len(powers), P) sums; exact, since they are whole numbers below 2^24.
    """
    rows, cols = places
    side = 2 * half + 1
    offset = np.arange(-half, half + 1, dtype=np.float32)
    kernels = np.array([np.outer(offset**q, offset**p).ravel() for p, q in powers], dtype=np.float32)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(mask.view(np.uint8), half), (side, side))
    sums = np.empty((len(powers), len(rows)))
    step = max(1, _CELLS_AT_ONCE // side**2)
    for first in range(0, len(rows), step):
        part = slice(first, first + step)
        sums[:, part] = kernels @ windows[rows[part], cols[part]].reshape(-1, side * side).astype(np.float32).T
    return sums


def _directions(moments: Array) -> tuple[Array, Array]:
    """Normals and linearity of wall cells from the (6, P) moments of the cells about each, up to the second."""
    count, mean_x, mean_y, xx, xy, yy = moments
    cxx = xx - mean_x * mean_x / count
    cyy = yy - mean_y * mean_y / count
    cxy = xy - mean_x * mean_y / count
    angle = 0.5 * np.arctan2(2.0 * cxy, cxx - cyy)
    spread = np.hypot(cxx - cyy, 2.0 * cxy)
    linearity = np.where(count >= 3.0, spread / np.maximum(cxx + cyy, 1e-9), 0.0)
    return np.stack([-np.sin(angle), np.cos(angle)], axis=-1), np.clip(linearity, 0.0, 1.0)
