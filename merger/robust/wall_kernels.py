"""Hot loops of the robust method: how the walls of one map fall onto another, in few calls on long arrays."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.intp]

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""Values of `Fields.state`."""

NUM_SUMS = 9
"""Length of what `compare_walls` returns."""


class Walls(NamedTuple):
    """Wall points of one map, frame ``field``; all of a point lies together in one table, so that look-ups are fast."""

    table: Array
    """(N, 8) x and y of the places, normals and facings, then linearity and length."""

    @property
    def points(self) -> Array:
        """(N, 2) places, metres."""
        return self.table[:, 0:2]

    @property
    def normals(self) -> Array:
        """(N, 2) unit normals, sign arbitrary."""
        return self.table[:, 2:4]

    @property
    def facing(self) -> Array:
        """(N, 2) direction to the free side, of length 0 (free all round, or nowhere) to 1 (one side wholly free)."""
        return self.table[:, 4:6]

    @property
    def linearity(self) -> Array:
        """(N,) 0..1: how much the wall about a point is a line, 0 for a lone point or a corner."""
        return np.asarray(self.table[:, 6])

    @property
    def lengths_m(self) -> Array:
        """(N,) wall length that each point stands for, metres."""
        return np.asarray(self.table[:, 7])

    def columns_of(self, numbers: Numbers | npt.NDArray[np.int32]) -> Array:
        """(8, M) columns of the table for some of the points, by number."""
        return np.ascontiguousarray(self.table.take(numbers, axis=0).T)


class Fields(NamedTuple):
    """What a map answers at any place, frame ``field``; its outermost cells answer for all places outside."""

    distance_m: npt.NDArray[np.float32]
    """(H, W) distance of each cell's centre to the nearest wall, metres; infinite in the outermost cells."""
    nearest: npt.NDArray[np.int32]
    """(H, W) number of the nearest wall point."""
    state: npt.NDArray[np.uint8]
    """(H, W) `UNKNOWN`, `FREE` or `OCCUPIED`; unknown in the outermost cells."""
    resolution_m: float
    """Cell side, metres."""


class View(NamedTuple):
    """One map as a partner of others: the points that are compared, all its points, and its fields."""

    sample: Walls
    """Points that are compared."""
    walls: Walls
    """All points, which the fields name."""
    fields: Fields
    """The look-up fields."""


def compare_walls(  # noqa: PLR0917 # the limits of `VerificationConfig`, in its order
    T: Array, walls: Walls, to: Walls, fields: Fields, near_m: float, far_m: float, tight_m: float, facing: float
) -> Array:
    """Sum up how one map's walls fall on another map.

    Args:
        T: (3, 3) motion of the walls' map into the other, frames ``field``.
        walls: The walls.
        to: The other map's walls.
        fields: The other map's fields.
        near_m: Nearer walls agree.
        far_m: Walls in free space farther from any wall than this conflict.
        tight_m: Width of the kernel that measures tightness.
        facing: Walls whose free sides' product is below minus this are opposite faces.

    Returns:
        (9,) metres: near, opposed, conflict, loose, tight, blunt; and xx, xy, yy of the sum of outer products of the
        normals of near walls, each times its length, in the walls' own frame.
    """
    x, y = move_points(T[None], walls.points)
    cells = find_cells(x[0], y[0], fields)
    distance = distances_of(fields, cells)
    state = fields.state.ravel().take(cells)
    lengths_m = walls.lengths_m
    conflict = lengths_m.take(np.flatnonzero((state == FREE) & (distance > far_m))).sum()
    loose = lengths_m.take(np.flatnonzero((state != UNKNOWN) & (distance > near_m) & (distance <= far_m))).sum()
    near = np.flatnonzero(distance <= near_m)
    own = walls.columns_of(near)
    opposed = _are_opposed(T, own[4:6], to, fields.nearest.ravel().take(cells.take(near)), facing)
    opposed_m = own[7, opposed].sum()
    same = np.flatnonzero(~opposed)
    n, (line, length) = own[2:4].take(same, axis=1), own[6:].take(same, axis=1)
    tight = (length * np.exp(-0.5 * (distance.take(near.take(same)) / tight_m) ** 2)).sum()
    xx, xy, _, yy = (n * (length * line) @ n.T).ravel()
    blunt = (length * (1.0 - line)).sum()
    return np.array([length.sum(), opposed_m, conflict, loose, tight, blunt, xx + 0.5 * blunt, xy, yy + 0.5 * blunt])


def find_agreeing(T: Array, walls: Walls, to: Walls, fields: Fields, near_m: float, facing: float) -> Numbers:  # noqa: PLR0917
    """(N,) rising numbers of the walls that `compare_walls` counts as near; its arguments."""
    x, y = move_points(T[None], walls.points)
    cells = find_cells(x[0], y[0], fields)
    near = np.flatnonzero(distances_of(fields, cells) <= near_m)
    facings, met = walls.facing.take(near, axis=0).T, fields.nearest.ravel().take(cells.take(near))
    return near[~_are_opposed(T, facings, to, met, facing)]


def _are_opposed(
    T: Array, facings: Array, to: Walls, met: npt.NDArray[np.int32], facing: float
) -> npt.NDArray[np.bool_]:
    """(M,) whether walls of (2, M) facings and the walls they meet, by number, are opposite faces."""
    return turned_product(T[0, 0], T[1, 0], *facings, *to.columns_of(met)[4:6]) < -facing


def score_walls(  # noqa: PLR0917 # the limits of `VerificationConfig`, in its order
    T: Array, walls: Walls, to: Walls, fields: Fields, near_m: float, far_m: float, facing: float
) -> tuple[Array, Array]:
    """Agreement and conflict of several motions, as `compare_walls` sums them up.

    Args:
        T: (K, 3, 3) motions of the walls' map into the other, frames ``field``.
        walls: The walls.
        to: The other map's walls.
        fields: The other map's fields.
        near_m: See `compare_walls`.
        far_m: See `compare_walls`.
        facing: See `compare_walls`.

    Returns:
        (K,) metres of wall that are near, and (K,) that conflict.
    """
    x, y = (values.ravel() for values in move_points(T, walls.points))
    cells = find_cells(x, y, fields)
    distance = distances_of(fields, cells)
    conflict = np.where((fields.state.ravel().take(cells) == FREE) & (distance > far_m), 1.0, 0.0).reshape(len(T), -1)
    near = np.flatnonzero(distance <= near_m)
    motion, point = split_numbers(near, len(walls.points))
    met = fields.nearest.ravel().take(cells.take(near))
    own = walls.columns_of(point)
    sides = (*own[4:6], *to.columns_of(met)[4:6])
    same = turned_product(*T[:, :2, 0].T.take(motion, axis=1), *sides) >= -facing
    agreeing_m = np.asarray(np.bincount(motion, own[7] * same, len(T)), np.float64)
    return agreeing_m, np.einsum("ij,j", conflict, walls.lengths_m)


def count_free(T: Array, points: Array, fields: Fields) -> int:
    """Number of (N, 2) points that T (3, 3) puts into free cells."""
    x, y = move_points(T[None], points)
    return int(np.count_nonzero(fields.state.ravel()[find_cells(x[0], y[0], fields)] == FREE))


def split_numbers(numbers: Numbers, count: int) -> tuple[Numbers, Numbers]:
    """Number of the motion and of the point, by the number of each among ``count`` points under each motion."""
    motion = numbers // count
    return motion, numbers - motion * count


def move_points(T: Array, points: Array) -> tuple[Array, Array]:
    """(K, N) x and y of (N, 2) points under (K, 3, 3) motions."""
    x, y = np.ascontiguousarray(points.T)
    return (
        T[:, 0, :1] * x + T[:, 0, 1:2] * y + T[:, 0, 2:],
        T[:, 1, :1] * x + T[:, 1, 1:2] * y + T[:, 1, 2:],
    )


def find_cells(x: Array, y: Array, fields: Fields) -> Numbers:
    """Flat number of the cell that holds each place; outside, of an outermost cell."""
    rows, cols = fields.state.shape
    col, row = x * (1.0 / fields.resolution_m), y * (1.0 / fields.resolution_m)
    for places, count in ((col, cols), (row, rows)):
        np.maximum(places, 0.0, out=places)
        np.minimum(places, count - 1.0, out=places)
    cells = row.astype(np.intp)
    cells *= cols
    cells += col.astype(np.intp)
    return cells


def distances_of(fields: Fields, cells: Numbers) -> Array:
    """Distance of flat cells to the nearest wall, metres; in double precision, as limits are."""
    return fields.distance_m.ravel().take(cells).astype(np.float64)


def turned_product(c: Array, s: Array, ax: Array, ay: Array, bx: Array, by: Array) -> Array:  # noqa: PLR0917
    """Scalar product of a, turned by the angle whose cosine and sine are given, with b."""
    return np.asarray(c * (ax * bx + ay * by) + s * (ax * by - ay * bx))
