"""A dataset's maps as arrays on disk: a call maps them into its memory, where decoding images costs it 15 ms.

The arrays are what `merger.map_server.read_map` gives, to the last bit; the truth is not among them.
"""

import json
import mmap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap
from merger.map_server import read_map

_CELLS, _INDEX = "cells.float32", "maps.json"
_ALIGNMENT = 16
"""Every map begins at a multiple of so many cells (64 bytes), as arrays do that were allocated."""


def write_map_cache(maps: Sequence[GridMap], folder: Path) -> None:
    """Write maps into an existing folder."""
    index: dict[str, dict[str, Any]] = {}
    starts = np.cumsum([0, *(-(-grid.log_odds.size // _ALIGNMENT) * _ALIGNMENT for grid in maps)]).tolist()
    cells = np.zeros(starts[-1], dtype=np.float32)
    for grid, start in zip(maps, starts, strict=False):
        cells[start : start + grid.log_odds.size] = grid.log_odds.ravel()
        place = {"resolution_m": grid.resolution_m, "T_map_grid": grid.T_map_grid.tolist()}
        index[grid.name] = place | {"start": start, "shape": grid.log_odds.shape}
    cells.tofile(folder / _CELLS)
    (folder / _INDEX).write_text(json.dumps(index), encoding="utf-8")


def read_cached_maps(paths: Sequence[Path], folder: Path) -> list[GridMap]:
    """Maps by their YAML files: from the cache where it is, else from the files themselves.

    What is written to their cells stays in this process.
    """
    if not (folder / _INDEX).is_file():
        return [read_map(path) for path in paths]
    index = json.loads((folder / _INDEX).read_text(encoding="utf-8"))
    with (folder / _CELLS).open("rb") as file:  # bare: reading a header would cost a forked process 2 ms
        cells = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY), dtype=np.float32)
    return [_cut_out(cells, path.stem, index[path.stem]) for path in paths]


def _cut_out(cells: npt.NDArray[np.float32], name: str, entry: dict[str, Any]) -> GridMap:
    rows, cols = entry["shape"]
    log_odds = cells[entry["start"] : entry["start"] + rows * cols].reshape(rows, cols)
    return GridMap(name, log_odds, entry["resolution_m"], np.array(entry["T_map_grid"]))
