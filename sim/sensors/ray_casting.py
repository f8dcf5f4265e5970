"""Ray casting: a walk over a uniform grid of wall segments, cell by cell until the nearest wall is found.

Source: Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987. What counts as a
hit is Chipmunk's (pymunk's) ``segment_query_first`` with radius 0, to the last comparison: the end points of a wall
belong to it; a ray that starts on a wall or in a disc meets it at range 0; a ray along a wall, or one that ends on it,
does not meet it. The kernels take many rays a call: a call costs as much as casting a ray.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from sim.sensors.segment_grid import MARGIN_M, SegmentGrid

NO_HIT = -1
"""Index of the segment that a ray without hit has met."""
DISC_HIT = -2
"""Index of the segment that a ray has met that ended at a disc."""

_CHUNK_RAYS = 2048
"""Rays that are in memory at a time."""


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


def cast_rays(
    grid: SegmentGrid,
    origins_m: npt.NDArray[np.float64],
    angles_rad: npt.NDArray[np.float64],
    limit_m: float,
    discs: Discs = NO_DISCS,
) -> RayHits:
    """The first wall or disc that each ray meets.

    For rays of any start and direction, one by one, with what they met: nothing here needs a lidar. The lidar casts
    whole scans by the same kernels (`sim.sensors.scan_kernel`); by this function they are held against pymunk's rays.

    Args:
        grid: The walls.
        origins_m: (R, 2) where the rays start, metres.
        angles_rad: (R,) directions, radians.
        limit_m: Length of the rays.
        discs: Round obstacles besides the walls.
    """
    count = len(angles_rad)
    hits = RayHits(np.empty(count), np.empty(count, dtype=np.int64), np.empty(count))
    origins_m, angles_rad = np.asarray(origins_m, dtype=np.float64), np.asarray(angles_rad, dtype=np.float64)
    for first in range(0, count, _CHUNK_RAYS):
        part = slice(first, first + _CHUNK_RAYS)
        centers_m = discs.centers_m[part] if len(discs.centers_m) > 1 else discs.centers_m
        found = RayHits(hits.ranges_m[part], hits.segments[part], hits.incidence_cos[part])
        _cast(grid, Discs(centers_m, discs.radii_m), (origins_m[part], angles_rad[part], float(limit_m)), found)
    return hits


@njit(cache=True, nogil=True)
def meet_walls(grid, rays, fractions, walls):  # type: ignore[no-untyped-def] # a kernel
    """The nearest wall on each ray's way.

    Args:
        grid: The walls.
        rays: (R, 4) start x, y and way dx, dy to its end, metres.
        fractions: (R,) is set to the fraction of the way at which it is met; 2.0 for none.
        walls: (R,) is set to its index; NO_HIT for none.
    """
    (rows, columns), (corner_x, corner_y) = grid.shape, grid.corner_m
    cell_begin, entries, members, cells_per_m = grid.cell_begin, grid.entries, grid.members, grid.cells_per_m
    for i in range(len(rays)):
        x, y, dx, dy = rays[i]
        start_x, way_x = (x - corner_x) * cells_per_m, dx * cells_per_m
        start_y, way_y = (y - corner_y) * cells_per_m, dy * cells_per_m
        column, row = _first_cell((start_x, way_x, columns), (start_y, way_y, rows))
        step_x, next_x, per_x = _steps(column, start_x, way_x)
        step_y, next_y, per_y = _steps(row, start_y, way_y)
        best, wall = 2.0, NO_HIT
        while 0 <= column < columns and 0 <= row < rows:
            cell = np.uint64(row * columns + column)  # unsigned: an index need not be tested for its sign
            for k in range(cell_begin[cell], cell_begin[cell + np.uint64(1)]):
                e = np.uint64(k)
                entry = (entries[e, 0], entries[e, 1], entries[e, 2], entries[e, 3], entries[e, 4], entries[e, 5])
                t = _meet(entry, (x, y, dx, dy))
                if t < best:
                    best, wall = t, members[e]
            leave = min(next_x, next_y)
            if best <= leave or leave > 1.0:
                break
            if next_x < next_y:
                column, next_x = column + step_x, next_x + per_x
            else:
                row, next_y = row + step_y, next_y + per_y
        fractions[i], walls[i] = best, wall


@njit(cache=True, nogil=True)
def measure_incidence(segments, rays, walls, cosines):  # type: ignore[no-untyped-def] # a kernel
    """Set (R,) cosines of the angle between rays and the normals of the (R,) walls that they meet; 0 for no wall."""
    for i in range(len(rays)):
        cosines[i] = 0.0
        if walls[i] >= 0:
            across = abs(rays[i, 2] * segments[walls[i], 4] + rays[i, 3] * segments[walls[i], 5])
            cosines[i] = min(across / math.sqrt(rays[i, 2] * rays[i, 2] + rays[i, 3] * rays[i, 3]), 1.0)


@njit(cache=True, nogil=True)
def meet_discs(discs, rays, found):  # type: ignore[no-untyped-def] # a kernel
    """Cut rays short at discs.

    Args:
        discs: The discs, (R, K, 2) or (1, K, 2).
        rays: (R, 4), as for `meet_walls`.
        found: (R,) fractions, walls and cosines so far, changed where a disc is nearer.
    """
    (centers, radii), (fractions, walls, cosines) = discs, found
    for k in range(len(radii)):
        for i in range(len(rays)):
            x, y, dx, dy = rays[i]
            row = i if len(centers) > 1 else 0
            t, cosine = _meet_disc((centers[row, k, 0] - x, centers[row, k, 1] - y, radii[k]), dx, dy)
            if t < fractions[i]:
                fractions[i], walls[i], cosines[i] = t, DISC_HIT, cosine


@njit(cache=True, nogil=True)
def _cast(grid, discs, aims, hits):  # type: ignore[no-untyped-def] # a kernel
    """Cast rays from their (R, 2) origins, (R,) angles and length."""
    origins_m, angles_rad, limit_m = aims
    ranges_m, walls, cosines = hits
    rays = np.empty((len(angles_rad), 4))
    for i in range(len(rays)):
        x, y = origins_m[i]
        # The way is the difference of two places, as it is in Chipmunk.
        dx, dy = (x + limit_m * math.cos(angles_rad[i])) - x, (y + limit_m * math.sin(angles_rad[i])) - y
        rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3] = x, y, dx, dy
    meet_walls(grid, rays, ranges_m, walls)
    measure_incidence(grid.segments, rays, walls, cosines)
    meet_discs(discs, rays, (ranges_m, walls, cosines))
    for i in range(len(rays)):
        ranges_m[i] = ranges_m[i] * limit_m if ranges_m[i] <= 1.0 else np.inf


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
def _steps(cell, start, way):  # type: ignore[no-untyped-def] # a kernel
    """Along one axis: step to the next cell, fraction of the way at which it is reached, fraction between cells."""
    if way == 0.0:
        return 0, np.inf, np.inf
    per = 1.0 / way
    return (1 if way > 0.0 else -1), (cell + (way > 0.0) - start) * per, abs(per)


@njit(cache=True, nogil=True)
def _meet(segment, ray):  # type: ignore[no-untyped-def] # a kernel
    """Fraction of the way at which a ray meets a segment, or 2.0, by Chipmunk's comparisons."""
    x1, y1, x2, y2, nx, ny = segment
    x, y, dx, dy = ray
    ax, ay, bx, by = x1 - x, y1 - y, x2 - x, y2 - y
    if (dx * ay - dy * ax) * (dx * by - dy * bx) > 0.0:
        return 2.0
    distance = ax * nx + ay * ny
    if abs(distance) < MARGIN_M and _lies_on(segment, x, y):
        return 0.0
    before, after = -distance, dx * nx + dy * ny - distance
    return before / (before - after) if before * after < 0.0 else 2.0


@njit(cache=True, nogil=True)
def _lies_on(segment, x, y):  # type: ignore[no-untyped-def] # a kernel
    """Whether a point is its own nearest point on a segment, by Chipmunk's arithmetic."""
    x1, y1, x2, y2, _, _ = segment
    along_x, along_y = x1 - x2, y1 - y2
    length_squared = along_x * along_x + along_y * along_y
    share = (along_x * (x - x2) + along_y * (y - y2)) / length_squared if length_squared > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return x2 + along_x * share == x and y2 + along_y * share == y


@njit(cache=True, nogil=True)
def _meet_disc(disc, dx, dy):  # type: ignore[no-untyped-def] # a kernel
    """Fraction of the way at which a ray meets a disc (2.0: never), and the cosine of incidence.

    Args:
        disc: Its centre x, y as seen from the ray's start, and its radius, metres.
        dx: The ray's way.
        dy: The ray's way.
    """
    to_x, to_y, radius = disc
    length_squared, off = dx * dx + dy * dy, dx * to_y - dy * to_x
    under_root = length_squared * radius * radius - off * off
    if under_root < 0.0:
        return 2.0, 0.0
    if to_x * to_x + to_y * to_y <= radius * radius:
        return 0.0, 1.0
    along = dx * to_x + dy * to_y
    t = (along - math.sqrt(under_root)) / length_squared
    if along <= 0.0 or t > 1.0:
        return 2.0, 0.0
    return t, math.sqrt(under_root / length_squared) / radius
