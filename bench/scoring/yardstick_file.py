"""A yardstick on disk, so that it is worked out when its dataset is made, and not while methods are timed.

The file is mapped into memory as it is: whole numbers, then floating-point numbers, then cells, a byte each.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.scoring.grid_metrics import TrueGrid
from bench.scoring.map_raster import Raster, Sheet
from bench.scoring.yardstick import Yardstick
from sim.maps.truth import Truth

_MAGIC = 0x4B43495453445259
_HEAD = 5
"""Whole numbers before those of each map: the magic number, maps, edge points, rows and columns of the true map."""
_FACTS = 4
"""Floating-point numbers before those of each map: left and lower edge and cell of the raster, the floor."""
_PER_MAP = 11
"""Floating-point numbers of each map: its resolution, its sheet's, and the sheet's place."""


def encode_yardstick(yardstick: Yardstick) -> bytes:
    """The content of a file: all but the truth; the numbers come back as they were, to the last bit."""
    grid, raster, edges = yardstick.grid, yardstick.grid.raster, yardstick.edges_map
    head = [_MAGIC, len(edges), sum(map(len, edges)), raster.rows, raster.cols]
    whole = [*head, *map(len, edges), *(n for sheet in grid.sheets for n in sheet.marks.shape)]
    facts = [raster.x_min_m, raster.y_min_m, raster.cell_m, yardstick.objective_floor]
    maps = zip(yardstick.resolutions_m, grid.sheets, strict=True)
    numbers = [[m, sheet.resolution_m, *sheet.T_map_sheet.ravel().tolist()] for m, sheet in maps]
    floats = np.concatenate([facts, np.ravel(numbers), *map(np.ravel, edges)])
    return b"".join(
        [np.array(whole, dtype=np.int64).tobytes(), floats.tobytes(), grid.cells.tobytes(), grid.marks.tobytes()]
    )


def read_yardstick(path: Path, truth: Truth) -> Yardstick | None:
    """A yardstick that was written, for the truth of its dataset; none where there is no sound file."""
    try:
        data = np.asarray(np.memmap(path, dtype=np.uint8, mode="c"))
    except (OSError, ValueError):
        return None
    head = data[: 8 * _HEAD].view(np.int64).tolist() if len(data) >= 8 * _HEAD else [0]
    if head[0] != _MAGIC:
        return None
    _, count, num_edges, rows, cols = head
    ends = np.cumsum([8 * (_HEAD + 3 * count), 8 * (_FACTS + _PER_MAP * count + 2 * num_edges), rows * cols])
    whole, floats, cells, marks = np.split(data, ends)
    sizes = whole.view(np.int64)[_HEAD:]
    shapes = sizes[count:].reshape(-1, 2)
    if len(marks) != shapes.prod(axis=1).sum():
        return None
    facts, numbers, edges = np.split(floats.view(np.float64), [_FACTS, _FACTS + _PER_MAP * count])
    per_map = numbers.reshape(-1, _PER_MAP)
    x_min_m, y_min_m, cell_m, floor = facts.tolist()
    raster = Raster(x_min_m, y_min_m, cell_m, rows, cols)
    sheets = _sheets(marks, shapes, per_map[:, 1:])
    return Yardstick(
        truth=truth,
        edges_map=tuple(np.split(edges.reshape(-1, 2), np.cumsum(sizes[:count])[:-1])),
        resolutions_m=tuple(per_map[:, 0].tolist()),
        grid=TrueGrid(sheets, marks, truth.T_world_map, raster, cells.reshape(rows, cols)),
        objective_floor=floor,
    )


def _sheets(
    marks: npt.NDArray[np.uint8], shapes: npt.NDArray[np.int64], numbers: npt.NDArray[Any]
) -> tuple[Sheet, ...]:
    parts = np.split(marks, np.cumsum(shapes.prod(axis=1))[:-1])
    return tuple(
        Sheet(part.reshape(shape), float(row[0]), row[1:].reshape(3, 3))
        for part, shape, row in zip(parts, shapes.tolist(), numbers, strict=True)
    )
