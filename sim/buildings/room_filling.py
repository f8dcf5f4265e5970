"""One room as it fills up: pieces find a place on the free floor, anywhere or with their back to a wall."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from sim.buildings import furniture
from sim.buildings.furniture import Piece
from sim.buildings.plan import Array, Solid

Mask = npt.NDArray[np.bool_]

CELL_M = 0.05
"""Side of a cell of the floor."""
_TRIES = 14
"""Places tried for a piece before it is left out."""


class Filler:
    """One room's free floor while it fills up."""

    def __init__(self, usable: Mask, walls: Mask, origin_m: Array, rng: np.random.Generator) -> None:
        """Begin with the (H, W) cells that may be taken, those of walls, and the (2,) corner of cell (0, 0), metres."""
        self.usable, self.origin_m, self.rng = usable, origin_m, rng
        self.solids: list[Solid] = []
        self._backs = _wall_cells(usable, walls)
        self._cells = np.argwhere(usable)

    def put(self, piece: Piece, against_wall: bool) -> None:
        """Find a place for a piece and put it there; without a place it is left out."""
        places = self._backs if against_wall else self._cells
        if len(places) == 0:
            return
        for k in self.rng.integers(0, len(places), _TRIES):
            row, col = places[k][:2]
            if against_wall:
                angle = float(places[k][2]) * math.pi / 2.0
            else:
                angle = float(self.rng.integers(0, 4)) * math.pi / 2.0 + self.rng.normal(0.0, 0.08)
            x, y = (np.array([col, row]) + 0.5) * CELL_M + self.origin_m
            if self._stand(piece, x, y, angle):
                return

    def put_bays(self) -> None:
        """A row of equal piers along the longest wall of one side of the room."""
        if len(self._backs) == 0:
            return
        side = self._backs[self.rng.integers(len(self._backs)), 2]
        wall = self._backs[self._backs[:, 2] == side]
        across = 0 if side % 2 == 0 else 1
        line = wall[wall[:, across] == np.bincount(wall[:, across]).argmax()]
        step = round(self.rng.uniform(0.9, 2.4) / CELL_M)
        piece = furniture.pier(self.rng)
        first = int(self.rng.integers(step))
        for row, col, _ in line[first::step]:
            x, y = (np.array([col, row]) + 0.5) * CELL_M + self.origin_m
            self._stand(piece, x, y, float(side) * math.pi / 2.0)

    def _stand(self, piece: Piece, x: float, y: float, angle_rad: float) -> bool:
        """Put a piece at a pose if its floor is free."""
        free = self._claim(furniture.footprint(piece, x, y, angle_rad, 0.02))
        if free:
            self.solids.extend(furniture.place(piece, x, y, angle_rad))
        return free

    def _claim(self, polygon: Array) -> bool:
        """Take the cells below a footprint if all of them are usable."""
        pixels = np.floor((polygon - self.origin_m) / CELL_M).astype(np.int32)
        low, high = pixels.min(axis=0), pixels.max(axis=0) + 1
        if low.min() < 0 or high[0] > self.usable.shape[1] or high[1] > self.usable.shape[0]:
            return False
        window = self.usable[low[1] : high[1], low[0] : high[0]]
        shape = np.zeros(window.shape, dtype=np.uint8)
        cv2.fillConvexPoly(shape, pixels - low, 1)
        if not window[shape > 0].all():
            return False
        window[shape > 0] = False
        return True


def _wall_cells(usable: Mask, walls: Mask) -> npt.NDArray[np.int64]:
    """(N, 3) row, column, and quarter turns of a piece whose back is to the wall beside that cell."""
    padded = np.pad(walls, 1)
    found = []
    for quarter, (d_row, d_col) in enumerate([(-1, 0), (0, 1), (1, 0), (0, -1)]):
        beside = padded[1 + d_row : 1 + d_row + walls.shape[0], 1 + d_col : 1 + d_col + walls.shape[1]]
        cells = np.argwhere(usable & beside)
        found.append(np.column_stack([cells, np.full(len(cells), quarter)]))
    return np.concatenate(found)
