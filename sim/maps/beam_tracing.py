"""The kernels of occupancy mapping: which cells a scan's beams cross, and their log-odds, each cell once a scan."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

_FREE, _HIT = 1, 2
"""Marks of the cells that a scan has touched; 0 is untouched."""


class BeamModel(NamedTuple):
    """What a beam does to the cells that it meets."""

    max_range_m: float
    """A longer beam frees cells up to this range, and hits none."""
    no_return_free_m: float
    """A beam without return frees cells up to this range; 0 ignores such beams."""
    log_odds_hit: float
    """Added to a cell that holds the end of a beam."""
    log_odds_miss: float
    """Added to every other cell that a beam crosses."""
    log_odds_limit: float
    """Bound of a cell's absolute log-odds."""


class Sweep(NamedTuple):
    """Where the beams of scans start and go."""

    directions: npt.NDArray[np.float64]
    """(B, 2) unit vectors of the beams in frame ``lidar``."""
    motions: npt.NDArray[np.float64]
    """(S, 3) how the lidar moves from one beam to the next: `sim.maps.scan_skew.motion_per_beam`."""


def beam_extent(
    ranges_m: npt.NDArray[np.float32], T_map_lidar: npt.NDArray[np.float64], sweep: Sweep, model: BeamModel
) -> npt.NDArray[np.float64]:
    """The box that holds all lidars and beams' ends.

    Args:
        ranges_m: (S, B) ranges, by REP 117.
        T_map_lidar: (S, 3, 3) poses of the lidar at the first beams.
        sweep: Where the beams start and go.
        model: Which part of a beam counts.

    Returns:
        (4,) x_min, y_min, x_max, y_max in metres, frame ``map``.
    """
    return np.asarray(_extent(ranges_m, T_map_lidar, sweep, model))


def integrate_scans(
    log_odds: npt.NDArray[np.float32],
    ranges_m: npt.NDArray[np.float32],
    T_cells_lidar: npt.NDArray[np.float64],
    sweep: Sweep,
    model: BeamModel,
) -> None:
    """Add scans to a grid in place: each cell at most once a scan, hits before misses, cells crossed exactly.

    Args:
        log_odds: (H, W) grid, changed; it must hold all beams (`beam_extent`).
        ranges_m: (S, B) ranges, by REP 117: +inf no return, -inf too near and NaN invalid (both ignored).
        T_cells_lidar: (S, 3, 3) maps metres of frame ``lidar`` at a scan's first beam to continuous cells (x = column,
            y = row): a similarity, its scale 1 / resolution.
        sweep: Where the beams start and go.
        model: What a beam does to the cells that it meets.
    """
    _integrate(log_odds, ranges_m, T_cells_lidar, sweep, model)


@njit(cache=True, nogil=True)
def _usable(range_m: float, max_range_m: float, no_return_free_m: float) -> tuple[float, bool]:
    """Length of the part of a beam that frees cells (0: the beam is ignored), and whether its end is a hit."""
    if not range_m > 0.0:
        return 0.0, False
    if range_m == np.inf:
        return no_return_free_m, False
    if range_m > max_range_m:
        return max_range_m, False
    return range_m, True


@njit(cache=True, nogil=True)
def _extent(ranges_m, T, sweep, model):  # type: ignore[no-untyped-def] # a kernel
    num_beams = len(sweep.directions)
    box = np.array([np.inf, np.inf, -np.inf, -np.inf])
    lengths, rays = np.empty(num_beams), np.empty((num_beams, 4))
    for s in range(len(ranges_m)):
        for b in range(num_beams):
            lengths[b], _ = _usable(ranges_m[s, b], model.max_range_m, model.no_return_free_m)
        _aim(T[s], lengths, sweep.directions, sweep.motions[s], rays)
        for b in range(num_beams):
            _widen(box, rays[b, 0], rays[b, 1])
            _widen(box, rays[b, 2], rays[b, 3])
    return box


@njit(cache=True, nogil=True)
def _aim(T, lengths, directions, motion, rays):  # type: ignore[no-untyped-def] # a kernel
    """The start and the end of each beam of a scan, while the lidar moves on evenly."""
    turn_x, turn_y = math.cos(motion[2]), math.sin(motion[2])
    heading_x, heading_y = 1.0, 0.0
    for b in range(len(lengths)):
        x, y = b * motion[0], b * motion[1]
        rays[b, 0], rays[b, 1] = T[0, 0] * x + T[0, 1] * y + T[0, 2], T[1, 0] * x + T[1, 1] * y + T[1, 2]
        x += lengths[b] * (heading_x * directions[b, 0] - heading_y * directions[b, 1])
        y += lengths[b] * (heading_y * directions[b, 0] + heading_x * directions[b, 1])
        rays[b, 2], rays[b, 3] = T[0, 0] * x + T[0, 1] * y + T[0, 2], T[1, 0] * x + T[1, 1] * y + T[1, 2]
        heading_x, heading_y = heading_x * turn_x - heading_y * turn_y, heading_y * turn_x + heading_x * turn_y


@njit(cache=True, nogil=True)
def _widen(box, x, y):  # type: ignore[no-untyped-def] # a kernel
    box[0], box[1] = min(box[0], x), min(box[1], y)
    box[2], box[3] = max(box[2], x), max(box[3], y)


@njit(cache=True, nogil=True)
def _integrate(log_odds, ranges_m, T, sweep, model):  # type: ignore[no-untyped-def] # a kernel
    """Mark the cells of one scan (misses first, so that hits overwrite them), then add the marks of its box."""
    num_beams = len(sweep.directions)
    marks = np.zeros(log_odds.shape, dtype=np.uint8)
    lengths, hits, rays = np.empty(num_beams), np.empty(num_beams, dtype=np.bool_), np.empty((num_beams, 4))
    box = np.empty(4)
    for s in range(len(ranges_m)):
        for b in range(num_beams):
            lengths[b], hits[b] = _usable(ranges_m[s, b], model.max_range_m, model.no_return_free_m)
        _aim(T[s], lengths, sweep.directions, sweep.motions[s], rays)
        box[0], box[1], box[2], box[3] = rays[0, 0], rays[0, 1], rays[0, 0], rays[0, 1]
        for b in range(num_beams):
            if lengths[b] > 0.0:
                _widen(box, rays[b, 0], rays[b, 1])
                _widen(box, rays[b, 2], rays[b, 3])
                _mark_crossed(marks, rays[b, 0], rays[b, 1], rays[b, 2], rays[b, 3])
        for b in range(num_beams):
            if hits[b]:
                marks[int(rays[b, 3]), int(rays[b, 2])] = _HIT
        _add_marks(log_odds, marks, box, model)


@njit(cache=True, nogil=True)
def _mark_crossed(marks, x0, y0, x1, y1):  # type: ignore[no-untyped-def] # a kernel
    """Mark every cell that the segment crosses: along its longer axis it meets one or two cells a step."""
    row_stride, column_stride = marks.shape[1], 1
    if abs(y1 - y0) > abs(x1 - x0):
        x0, y0, x1, y1 = y0, x0, y1, x1
        row_stride, column_stride = column_stride, row_stride
    if x1 < x0:
        x0, y0, x1, y1 = x1, y1, x0, y0
    flat = marks.ravel()
    slope = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
    first, last = int(x0), int(x1)
    row_in = int(y0)
    for column in range(first, last):
        row_out = int(y0 + slope * (column + 1 - x0))
        flat[row_in * row_stride + column * column_stride] = _FREE
        flat[row_out * row_stride + column * column_stride] = _FREE
        row_in = row_out
    flat[row_in * row_stride + last * column_stride] = _FREE
    flat[int(y1) * row_stride + last * column_stride] = _FREE


@njit(cache=True, nogil=True)
def _add_marks(log_odds, marks, box, model):  # type: ignore[no-untyped-def] # a kernel
    """Add the marked cells' log-odds and clear the marks."""
    zero, limit = np.float32(0.0), np.float32(model.log_odds_limit)
    hit, miss = np.float32(model.log_odds_hit), np.float32(model.log_odds_miss)
    first, last = int(box[0]), int(box[2]) + 1
    for row in range(int(box[1]), int(box[3]) + 1):
        cells, marked = log_odds[row, first:last], marks[row, first:last]
        for k in range(len(marked)):
            change = hit if marked[k] == _HIT else (miss if marked[k] == _FREE else zero)
            cells[k] = min(max(cells[k] + change, -limit), limit)
            marked[k] = 0
