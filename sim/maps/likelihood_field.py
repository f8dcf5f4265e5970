"""The kernels of scan matching: a growing field of nearness to the surfaces seen so far, and how well points fit it.

A cell's value is exp(-d^2 / (2 sigma^2)) of the distance d from its centre to the nearest surface; a surface is the
line between the ends of two neighbouring beams, where they are close, else the end of a beam alone. The coarse field
holds, for a block of BLOCK x BLOCK cells, the largest value of it and of the blocks above and to the right: a bound
of what a point gains by any shift of less than a block (Olson, "Real-time correlative scan matching", ICRA 2009).
"""

import math

import numpy as np
from numba import njit

BLOCK = 4
"""Cells along a side of a block of the coarse field."""
REACH_SIGMAS = 3.0
"""Farther than this from any surface the field is 0."""
_SHORTEST_LINE_CELLS = 2.0
"""Ends that lie closer together are joined by one line."""


@njit(cache=True, nogil=True)
def draw_surfaces(field, coarse, points, linked, sigma):  # type: ignore[no-untyped-def] # a kernel
    """Draw surfaces into the fields, in place; what lies outside is cut.

    Args:
        field: (H, W) float32, H and W multiples of BLOCK.
        coarse: (H / BLOCK, W / BLOCK) float32.
        points: (P, 2) x, y in cells; NaN where there is none.
        linked: (P,) whether a point and the next one bound the same surface.
        sigma: Width of the field, cells.
    """
    first = 0
    while first < len(points):
        last = first
        while linked[last] and (last == first or _are_near(points, first, last + 1)):
            last += 1
        if last > first or (points[first, 0] == points[first, 0] and not (first > 0 and linked[first - 1])):
            line = (points[first, 0], points[first, 1], points[last, 0], points[last, 1])
            _draw_line(field, coarse, line, sigma)
        first = max(last, first + 1)


@njit(cache=True, nogil=True)
def _are_near(points, i, j):  # type: ignore[no-untyped-def] # a kernel
    """Whether two ends are so near to each other that one line serves for all between them."""
    return math.hypot(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]) < _SHORTEST_LINE_CELLS


@njit(cache=True, nogil=True)
def _draw_line(field, coarse, line, sigma):  # type: ignore[no-untyped-def] # a kernel
    ax, ay, bx, by = line
    reach = REACH_SIGMAS * sigma
    along_x, along_y = bx - ax, by - ay
    length_squared = along_x * along_x + along_y * along_y
    for row in range(max(int(min(ay, by) - reach), 0), min(int(max(ay, by) + reach), field.shape[0] - 1) + 1):
        for column in range(max(int(min(ax, bx) - reach), 0), min(int(max(ax, bx) + reach), field.shape[1] - 1) + 1):
            x, y = column + 0.5 - ax, row + 0.5 - ay
            t = min(max((x * along_x + y * along_y) / length_squared, 0.0), 1.0) if length_squared > 0.0 else 0.0
            x, y = x - t * along_x, y - t * along_y
            distance_squared = x * x + y * y
            if distance_squared < reach * reach:
                value = np.float32(math.exp(-0.5 * distance_squared / (sigma * sigma)))
                if value > field[row, column]:
                    field[row, column] = value
                    _raise_bounds(coarse, row // BLOCK, column // BLOCK, value)


@njit(cache=True, nogil=True)
def _raise_bounds(coarse, row, column, value):  # type: ignore[no-untyped-def] # a kernel
    for r in range(max(row - 1, 0), row + 1):
        for c in range(max(column - 1, 0), column + 1):
            coarse[r, c] = max(coarse[r, c], value)


@njit(cache=True, nogil=True)
def search_pose(field, coarse, points, window, prior):  # type: ignore[no-untyped-def] # a kernel
    """The best pose on a lattice around the predicted one, by branch and bound over blocks of shifts.

    Args:
        field: (H, W) float32.
        coarse: Its bounds.
        points: (P, 2) points in cells, relative to the predicted position, turned by the predicted heading.
        window: Predicted position x, y in cells; half the width of the window in cells and in radians; step of the
            headings in radians.
        prior: Weight of one point's fit; inverse variance of a shift (1 / cells^2) and of a turn (1 / rad^2).

    Returns:
        Shift x, y (cells) and turn (radians) of the best pose, and its score.
    """
    _, _, reach, reach_rad, step_rad = window
    weight = prior[0]
    num_turns, num_shifts = math.ceil(reach_rad / step_rad), math.ceil(reach / BLOCK)
    side = 2 * num_shifts + 1
    cells = _turn_points(points, window, num_turns)
    blocks = cells // BLOCK
    bounds = np.empty(len(cells) * side * side)
    for place in range(len(bounds)):
        k, x, y = place // (side * side), place % side - num_shifts, place // side % side - num_shifts
        near_x, near_y = _nearest_shift(x), _nearest_shift(y)
        bound = weight * _sum_at(coarse, blocks[k], x, y)
        bounds[place] = bound - _penalty(near_x, near_y, (k - num_turns) * step_rad, prior)
    best, best_x, best_y, best_turn = -np.inf, 0.0, 0.0, 0.0
    for place in np.argsort(-bounds):
        if bounds[place] <= best:
            break
        k, turn = place // (side * side), (place // (side * side) - num_turns) * step_rad
        for b in range(BLOCK * BLOCK):
            x = (place % side - num_shifts) * BLOCK + b % BLOCK
            y = (place // side % side - num_shifts) * BLOCK + b // BLOCK
            score = weight * _sum_at(field, cells[k], x, y) - _penalty(x, y, turn, prior)
            if score > best:
                best, best_x, best_y, best_turn = score, float(x), float(y), turn
    return best_x, best_y, best_turn, best


@njit(cache=True, nogil=True)
def _turn_points(points, window, num_turns):  # type: ignore[no-untyped-def] # a kernel
    """(2 num_turns + 1, P, 2) cells of points at the predicted position, turned by each heading of the window."""
    x0, y0, _, _, step_rad = window
    cells = np.empty((2 * num_turns + 1, len(points), 2), dtype=np.int64)
    for k in range(len(cells)):
        cosine, sine = math.cos((k - num_turns) * step_rad), math.sin((k - num_turns) * step_rad)
        for i in range(len(points)):
            cells[k, i, 0] = math.floor(x0 + cosine * points[i, 0] - sine * points[i, 1])
            cells[k, i, 1] = math.floor(y0 + sine * points[i, 0] + cosine * points[i, 1])
    return cells


@njit(cache=True, nogil=True)
def _nearest_shift(block):  # type: ignore[no-untyped-def] # a kernel
    """The smallest absolute shift, in cells, of those that a block of shifts holds."""
    return float(block * BLOCK) if block >= 0 else float(-block * BLOCK - BLOCK + 1)


@njit(cache=True, nogil=True)
def _penalty(shift_x, shift_y, turn, prior):  # type: ignore[no-untyped-def] # a kernel
    """Log-likelihood that odometry takes from a pose."""
    _, shift_information, turn_information = prior
    return 0.5 * (shift_information * (shift_x**2 + shift_y**2) + turn_information * turn * turn)


@njit(cache=True, nogil=True)
def _sum_at(field, cells, shift_x, shift_y):  # type: ignore[no-untyped-def] # a kernel
    """Sum of the values of the field at (P, 2) cells x, y, shifted; 0 outside."""
    total = 0.0
    rows, columns = np.uint64(field.shape[0]), np.uint64(field.shape[1])
    for i in range(len(cells)):
        row, column = np.uint64(cells[i, 1] + shift_y), np.uint64(cells[i, 0] + shift_x)
        if row < rows and column < columns:  # unsigned: what is negative is too large
            total += field[row, column]
    return total
