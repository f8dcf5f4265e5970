"""Cut what corridors leave of a building into rooms, on a lattice of labels."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sim.buildings.floor_shape import FloorShape, Rect

Labels = npt.NDArray[np.int32]
Mask = npt.NDArray[np.bool_]

CELL_M = 0.1
"""Side of a lattice cell; walls run between cells."""
OUTSIDE, CORRIDOR = 0, 1
"""Labels of what is no room; halls and rooms have 2, 3, ..."""
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)
_SMALLEST_M2 = 4.0
_NARROWEST_M = 1.7
_DEEPEST_M = 8.5
"""Deeper blocks are halved before they are cut into rooms."""


@dataclass(frozen=True)
class FloorLabels:
    """A building with rooms."""

    labels: Labels
    """(H, W) label of each cell, row 0 at y = 0, a cell of outside all around."""
    num_halls: int
    """Labels 2 .. num_halls + 1 are halls."""
    even: dict[int, int]
    """Rooms of one row, cut evenly: their labels, and the row's number."""


def cut_rooms(shape: FloorShape, room_width_m: float, repeated: float, rng: np.random.Generator) -> FloorLabels:
    """Cut a building into rooms.

    Args:
        shape: The building.
        room_width_m: Mean width of a room.
        repeated: Probability that a row of rooms is cut into equal ones.
        rng: Of this building.

    Returns:
        The labels. Every room is connected; none is tiny.
    """
    labels, left = _raster(shape)
    even: dict[int, int] = {}
    label = 2 + len(shape.halls)
    _, blocks = cv2.connectedComponents(left.astype(np.uint8), connectivity=4)
    for block in range(1, int(blocks.max()) + 1):
        for row, strip in enumerate(_halve(blocks == block)):
            is_even = bool(rng.random() < repeated)
            for room in _slice(strip, room_width_m, is_even, rng):
                labels[room] = label
                if is_even:
                    even[label] = 100 * block + row
                label += 1
    _widen_ways(labels, 2 + len(shape.halls))
    _merge_small(labels, 2 + len(shape.halls))
    return FloorLabels(labels, len(shape.halls), even)


def label_rects(mask: Mask) -> list[Rect]:
    """Cover a mask of the lattice by rectangles in metres that do not overlap."""
    rects: list[Rect] = []
    open_runs: dict[tuple[int, int], int] = {}
    rows = np.nonzero(mask.any(axis=1))[0]
    for row in range(int(rows[0]), int(rows[-1]) + 2):
        line = mask[row] if row < len(mask) else np.zeros(mask.shape[1], dtype=np.bool_)
        edges = np.nonzero(np.diff(np.concatenate([[0], line.astype(np.int8), [0]])))[0].tolist()
        runs = set(zip(edges[::2], edges[1::2], strict=True))
        for run in [r for r in open_runs if r not in runs]:
            first = open_runs.pop(run)
            rects.append((run[0] * CELL_M, first * CELL_M, run[1] * CELL_M, row * CELL_M))
        for run in runs:
            open_runs.setdefault(run, row)
    return rects


def _raster(shape: FloorShape) -> tuple[Labels, Mask]:
    """Labels with outside, corridors and halls, and the cells that are left for rooms."""
    high = np.max([rect[2:] for rect in shape.footprint], axis=0)
    cols, rows = np.rint(high / CELL_M).astype(int) + 2
    labels = np.full((rows, cols), -1, dtype=np.int32)
    for k, rect in enumerate(shape.halls):
        _fill(labels, rect, 2 + k)
    for rect in shape.corridors:
        _fill(labels, rect, CORRIDOR)
    inside = np.zeros(labels.shape, dtype=np.int32)
    for rect in shape.footprint:
        _fill(inside, rect, 1)
    labels[inside == 0] = OUTSIDE
    return np.where(labels < 0, OUTSIDE, labels).astype(np.int32), (labels < 0)


def _fill(labels: Labels, rect: Rect, value: int) -> None:
    x0, y0, x1, y1 = (max(round(v / CELL_M), 0) + 1 for v in rect)
    labels[y0 : min(y1, len(labels) - 1), x0 : min(x1, labels.shape[1] - 1)] = value


def _halve(block: Mask) -> list[Mask]:
    """A deep block as two rows of rooms, back to back."""
    rows, cols = np.nonzero(block)
    height, width = np.ptp(rows) + 1, np.ptp(cols) + 1
    if min(height, width) * CELL_M <= _DEEPEST_M:
        return [block]
    halves = [block.copy(), block.copy()]
    middle = (int(rows.min()) + int(height) // 2) if height <= width else (int(cols.min()) + int(width) // 2)
    if height <= width:
        halves[0][middle:], halves[1][:middle] = False, False
    else:
        halves[0][:, middle:], halves[1][:, :middle] = False, False
    return halves


def _slice(strip: Mask, width_m: float, even: bool, rng: np.random.Generator) -> list[Mask]:
    """Cut a row across its longer side; the connected pieces are rooms."""
    rows, cols = np.nonzero(strip)
    if len(rows) == 0:
        return []
    along_x = np.ptp(cols) >= np.ptp(rows)
    low, high = (cols.min(), cols.max() + 1) if along_x else (rows.min(), rows.max() + 1)
    rooms: list[Mask] = []
    for a, b in zip(cuts := _cuts(int(low), int(high), width_m, even, rng), cuts[1:], strict=False):
        piece = np.zeros(strip.shape, dtype=np.uint8)
        window = (slice(None), slice(a, b)) if along_x else (slice(a, b), slice(None))
        piece[window] = strip[window]
        count, parts = cv2.connectedComponents(piece, connectivity=4)
        rooms.extend(parts == k for k in range(1, count))
    return rooms


def _cuts(low: int, high: int, width_m: float, even: bool, rng: np.random.Generator) -> list[int]:
    """Where to cut a stretch of the lattice."""
    count = max(1, round((high - low) * CELL_M / width_m))
    widths = np.ones(count) if even else rng.uniform(0.6, 1.6, count) * rng.choice([1.0, 1.0, 1.0, 2.0], count)
    inner = low + np.cumsum(widths / widths.sum()) * (high - low)
    return [low, *(int(v) for v in np.rint(inner[:-1])), high]


def _widen_ways(labels: Labels, first_room: int) -> None:
    """Give narrow arms of rooms that lie along a corridor to the corridor."""
    cells = round(_NARROWEST_M / CELL_M)
    for label in range(first_room, int(labels.max()) + 1):
        room = (labels == label).astype(np.uint8)
        arms = room - cv2.morphologyEx(room, cv2.MORPH_OPEN, np.ones((cells, cells), dtype=np.uint8))
        count, parts = cv2.connectedComponents(arms, connectivity=4)
        for part in range(1, count):
            around = cv2.dilate((parts == part).astype(np.uint8), _CROSS) > 0
            if np.count_nonzero(labels[around] == CORRIDOR) > cells:
                labels[parts == part] = CORRIDOR


def _merge_small(labels: Labels, first_room: int) -> None:
    """Give rooms that are tiny or narrow to the neighbour with which they share the longest wall."""
    for label in range(first_room, int(labels.max()) + 1):
        room = (labels == label).astype(np.uint8)
        if not room.any():
            continue
        narrow = 2.0 * cv2.distanceTransform(np.pad(room, 1), cv2.DIST_L2, 3).max() * CELL_M < _NARROWEST_M
        if np.count_nonzero(room) * CELL_M**2 >= _SMALLEST_M2 and not narrow:
            continue
        around = cv2.dilate(room, _CROSS) > room
        counts = np.bincount(labels[around])
        counts[OUTSIDE] = 0
        labels[room > 0] = np.argmax(counts) if counts.any() else OUTSIDE
