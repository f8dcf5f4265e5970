"""Ray casting: a walk over a uniform grid of wall segments, cell by cell until the nearest wall is found.

Source: Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987. What counts as a
hit is Chipmunk's (pymunk's) ``segment_query_first`` with radius 0, to the last comparison: the end points of a wall
belong to it; a ray that starts on a wall or in a disc meets it at range 0; a ray along a wall, or one that ends on it,
does not meet it.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

NO_HIT = -1
"""Index of the segment that a ray without hit has met."""
DISC_HIT = -2
"""Index of the segment that a ray has met that ended at a disc."""

_MARGIN_M = 1e-6
"""A segment belongs to every cell that it comes this near, so that rounding at a cell's border loses no hit."""
_CELLS_PER_SEGMENT = 2.0
"""Cells of the grid per segment: few enough to walk over quickly, enough that a cell holds few segments."""
_MAX_CELLS = 1 << 22


class SegmentGrid(NamedTuple):
    """Wall segments, sorted into square cells."""

    segments: npt.NDArray[np.float64]
    """(N, 6) x and y of a segment's first and second end, and of its unit normal, metres."""
    cell_begin: npt.NDArray[np.int64]
    """(rows, columns + 1) first of a cell's entries in ``members``; the next one is the cell's end."""
    members: npt.NDArray[np.int32]
    """(M,) indices of the segments of each cell, cell by cell."""
    corner_m: tuple[float, float]
    """Lower left corner of cell (0, 0)."""
    cells_per_m: float
    """Inverse of a cell's side."""


class Discs(NamedTuple):
    """Round obstacles, which may stand elsewhere for each ray or scan."""

    centers_m: npt.NDArray[np.float64]
    """(R, K, 2) centres for each of R rays or scans; R = 1 serves all."""
    radii_m: npt.NDArray[np.float64]
    """(K,) radii."""


class RayHits(NamedTuple):
    """What rays met first."""

    ranges_m: npt.NDArray[np.float64]
    """(R,) distances; +inf where nothing lies within the limit."""
    segments: npt.NDArray[np.int64]
    """(R,) index of the segment; NO_HIT or DISC_HIT."""
    incidence_cos: npt.NDArray[np.float64]
    """(R,) cosine of the angle between ray and surface normal, 0 to 1; 0 without a hit."""


NO_DISCS = Discs(np.zeros((1, 0, 2)), np.zeros(0))


def build_segment_grid(segments_m: npt.NDArray[np.float64], cell_m: float | None = None) -> SegmentGrid:
    """Sort wall segments into a uniform grid.

    Args:
        segments_m: (N, 2, 2) ends of the segments, metres; N may be 0.
        cell_m: Side of a cell; by default chosen from the number of segments and their extent.

    Raises:
        ValueError: a coordinate is not finite, or the cell is not > 0.
    """
    ends = np.asarray(segments_m, dtype=np.float64).reshape(-1, 2, 2)
    if not np.isfinite(ends).all():
        raise ValueError("wall segments must be finite")
    low, high = (ends.min(axis=(0, 1)), ends.max(axis=(0, 1))) if len(ends) else (np.zeros(2), np.zeros(2))
    low, size = low - 2 * _MARGIN_M, high - low + 4 * _MARGIN_M
    cell = _default_cell_m(size, len(ends)) if cell_m is None else cell_m
    if not cell > 0.0:
        raise ValueError(f"cell_m must be > 0, got {cell:g}")
    columns, rows = (int(n) for n in np.floor(size / cell) + 1)
    walls = np.concatenate([ends.reshape(-1, 4), _normals(ends)], axis=1)
    corner = (float(low[0]), float(low[1]))
    counts = np.zeros((rows, columns + 1), dtype=np.int64)
    _sort_segments(walls, corner, cell, counts, np.zeros(0, dtype=np.int32))
    begin = np.concatenate([[0], np.cumsum(counts)[:-1]]).reshape(counts.shape)
    members = np.zeros(int(counts.sum()), dtype=np.int32)
    _sort_segments(walls, corner, cell, begin.copy(), members)
    return SegmentGrid(walls, begin, members, corner, float(1.0 / cell))


def cast_rays(
    grid: SegmentGrid,
    origins_m: npt.NDArray[np.float64],
    angles_rad: npt.NDArray[np.float64],
    limit_m: float,
    discs: Discs = NO_DISCS,
) -> RayHits:
    """The first wall or disc that each ray meets.

    Args:
        grid: The walls.
        origins_m: (R, 2) where the rays start, metres.
        angles_rad: (R,) directions, radians.
        limit_m: Length of the rays.
        discs: Round obstacles besides the walls.
    """
    ends = origins_m + limit_m * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1)
    rays = np.concatenate([origins_m, ends - origins_m], axis=1)
    hits = RayHits(np.empty(len(rays)), np.empty(len(rays), dtype=np.int64), np.empty(len(rays)))
    first_walls(grid, rays, hits.ranges_m, hits.segments)
    _cast_all(grid, rays, limit_m, discs, hits)
    return hits


@njit(cache=True, nogil=True)
def first_walls(grid, rays, fractions, walls):  # type: ignore[no-untyped-def] # a kernel
    """`first_wall` of (R, 4) rays, written to (R,) fractions and (R,) indices."""
    nothing = np.zeros(0, dtype=np.bool_)
    for i in range(len(rays)):
        ray = (rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3])
        fractions[i], walls[i] = first_wall(grid, nothing, ray)


@njit(cache=True, nogil=True)
def first_wall(grid, passable, ray):  # type: ignore[no-untyped-def] # a kernel
    """Nearest wall on a ray's way.

    Args:
        grid: The walls.
        passable: (N,) segments that the ray passes through; empty for none.
        ray: Start x, y and way dx, dy to its end, metres.

    Returns: Fraction of the way at which it is met (2.0: none), and the segment's index.
    """
    x, y, dx, dy = ray
    best, wall = 2.0, NO_HIT
    rows, columns = grid.cell_begin.shape[0], grid.cell_begin.shape[1] - 1
    start_x, start_y = (x - grid.corner_m[0]) * grid.cells_per_m, (y - grid.corner_m[1]) * grid.cells_per_m
    way_x, way_y = dx * grid.cells_per_m, dy * grid.cells_per_m
    per_x, per_y = (1.0 / way_x if way_x != 0.0 else np.inf), (1.0 / way_y if way_y != 0.0 else np.inf)
    column, row = _first_cell((start_x, way_x, columns), (start_y, way_y, rows))
    if column < 0:
        return best, wall
    step_x, step_y = (1 if way_x > 0.0 else -1), (1 if way_y > 0.0 else -1)
    next_x = (column + (way_x > 0.0) - start_x) * per_x if way_x != 0.0 else np.inf
    next_y = (row + (way_y > 0.0) - start_y) * per_y if way_y != 0.0 else np.inf
    per_x, per_y = abs(per_x), abs(per_y)
    while True:
        for k in range(grid.cell_begin[row, column], grid.cell_begin[row, column + 1]):
            candidate = grid.members[k]
            t = _meet(grid.segments[candidate], ray)
            if t < best and not (len(passable) and passable[candidate]):
                best, wall = t, candidate
        leave = min(next_x, next_y)
        if best <= leave or leave > 1.0:
            return best, wall
        if next_x < next_y:
            column += step_x
            next_x += per_x
        else:
            row += step_y
            next_y += per_y
        if column < 0 or column >= columns or row < 0 or row >= rows:
            return best, wall


@njit(cache=True, nogil=True)
def first_disc(discs, row, ray):  # type: ignore[no-untyped-def] # a kernel
    """Nearest disc of one row on the way: fraction of the way (2.0: none) and the cosine of incidence."""
    x, y, dx, dy = ray
    best, cosine = 2.0, 0.0
    length_squared = dx * dx + dy * dy
    for k in range(len(discs.radii_m)):
        to_x, to_y = discs.centers_m[row, k, 0] - x, discs.centers_m[row, k, 1] - y
        radius = discs.radii_m[k]
        off, along = dx * to_y - dy * to_x, dx * to_x + dy * to_y
        under_root = length_squared * radius * radius - off * off
        if to_x * to_x + to_y * to_y <= radius * radius:
            return 0.0, 1.0
        if along <= 0.0 or under_root < 0.0:
            continue
        t = (along - math.sqrt(under_root)) / length_squared
        if 0.0 <= t < best and t <= 1.0:
            best, cosine = t, math.sqrt(under_root / length_squared) / radius
    return best, cosine


def _default_cell_m(size_m: npt.NDArray[np.float64], num_segments: int) -> float:
    """A cell that makes about _CELLS_PER_SEGMENT cells a segment."""
    wanted = max(_CELLS_PER_SEGMENT * num_segments, 1.0)
    return float(max(math.sqrt(size_m[0] * size_m[1] / wanted), size_m.max() / wanted, 1e-3))


def _normals(ends: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(N, 2) unit normals, rounded as Chipmunk rounds them; zero for a segment without length."""
    along = ends[:, 1] - ends[:, 0]
    length = np.sqrt(along[:, 0] * along[:, 0] + along[:, 1] * along[:, 1])
    unit = along * (1.0 / (length + np.finfo(np.float64).tiny))[:, None]
    return np.stack([unit[:, 1], -unit[:, 0]], axis=-1)


@njit(cache=True, nogil=True)
def _sort_segments(walls, corner_m, cell_m, places, members):  # type: ignore[no-untyped-def] # a kernel
    """Put each segment into the cells that it touches: ``places`` counts on; ``members``, if any, are written."""
    half = 0.5 * cell_m
    rows, columns = places.shape[0], places.shape[1] - 1
    for i in range(len(walls)):
        x1, y1, x2, y2, nx, ny = walls[i]
        reach = (abs(nx) + abs(ny)) * half + _MARGIN_M
        first_row = max(math.floor((min(y1, y2) - _MARGIN_M - corner_m[1]) / cell_m), 0)
        last_row = min(math.floor((max(y1, y2) + _MARGIN_M - corner_m[1]) / cell_m), rows - 1)
        first_column = max(math.floor((min(x1, x2) - _MARGIN_M - corner_m[0]) / cell_m), 0)
        last_column = min(math.floor((max(x1, x2) + _MARGIN_M - corner_m[0]) / cell_m), columns - 1)
        for row in range(first_row, last_row + 1):
            y = corner_m[1] + row * cell_m + half
            for column in range(first_column, last_column + 1):
                x = corner_m[0] + column * cell_m + half
                if abs((x - x1) * nx + (y - y1) * ny) <= reach:
                    if len(members):
                        members[places[row, column]] = i
                    places[row, column] += 1


@njit(cache=True, nogil=True)
def _cast_all(grid, rays, limit_m, discs, hits):  # type: ignore[no-untyped-def] # a kernel
    for i in range(len(rays)):
        ray = (rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3])
        t, wall, cosine = hits.ranges_m[i], hits.segments[i], 0.0
        if wall >= 0:
            cosine = abs(ray[2] * grid.segments[wall, 4] + ray[3] * grid.segments[wall, 5]) / limit_m
        t_disc, cosine_disc = first_disc(discs, min(i, len(discs.centers_m) - 1), ray)
        if t_disc < t:
            t, wall, cosine = t_disc, DISC_HIT, cosine_disc
        hits.ranges_m[i] = t * limit_m if t <= 1.0 else np.inf
        hits.segments[i], hits.incidence_cos[i] = wall, min(cosine, 1.0)


@njit(cache=True, nogil=True)
def _first_cell(along_x, along_y):  # type: ignore[no-untyped-def] # a kernel
    """Column and row in which a ray's walk begins; -1, -1 if it misses the grid."""
    (start_x, way_x, columns), (start_y, way_y, rows) = along_x, along_y
    if 0.0 <= start_x < columns and 0.0 <= start_y < rows:
        return int(start_x), int(start_y)
    enter = _enter_box(along_x, along_y)
    if enter > 1.0:
        return -1, -1
    return (
        int(min(max(start_x + enter * way_x, 0.0), columns - 0.5)),
        int(min(max(start_y + enter * way_y, 0.0), rows - 0.5)),
    )


@njit(cache=True, nogil=True)
def _enter_box(along_x, along_y):  # type: ignore[no-untyped-def] # a kernel
    """Fraction of the way at which a ray, in cells, enters the grid; 0 inside, 2.0 if it misses the grid."""
    enter, leave = 0.0, 1.0
    for start, way, size in (along_x, along_y):
        if way == 0.0:
            if start < 0.0 or start > size:
                return 2.0
        else:
            t1, t2 = -start / way, (size - start) / way
            enter, leave = max(enter, min(t1, t2)), min(leave, max(t1, t2))
    return enter if enter <= leave else 2.0


@njit(cache=True, nogil=True)
def _meet(segment, ray):  # type: ignore[no-untyped-def] # a kernel
    """Fraction of the way at which a ray meets a segment, or 2.0, by Chipmunk's comparisons."""
    x, y, dx, dy = ray
    ax, ay, bx, by = segment[0] - x, segment[1] - y, segment[2] - x, segment[3] - y
    if (dx * ay - dy * ax) * (dx * by - dy * bx) > 0.0:
        return 2.0
    distance = ax * segment[4] + ay * segment[5]
    if abs(distance) < _MARGIN_M and _lies_on(segment, x, y):
        return 0.0
    before, after = -distance, dx * segment[4] + dy * segment[5] - distance
    return before / (before - after) if before * after < 0.0 else 2.0


@njit(cache=True, nogil=True)
def _lies_on(segment, x, y):  # type: ignore[no-untyped-def] # a kernel
    """Whether a point is its own nearest point on a segment, by Chipmunk's arithmetic."""
    along_x, along_y = segment[0] - segment[2], segment[1] - segment[3]
    length_squared = along_x * along_x + along_y * along_y
    share = (along_x * (x - segment[2]) + along_y * (y - segment[3])) / length_squared if length_squared > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return segment[2] + along_x * share == x and segment[3] + along_y * share == y
