"""A yardstick on disk, so that it is worked out when its dataset is made, and not while methods are timed."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.scoring.grid_metrics import TrueGrid
from bench.scoring.map_raster import Raster, Sheet
from bench.scoring.vote_kernel import FREE, OCCUPIED
from bench.scoring.yardstick import Yardstick
from sim.maps.truth import Truth

Mask = npt.NDArray[np.bool_]


def encode_yardstick(yardstick: Yardstick) -> bytes:
    """The content of a file: all but the truth; the numbers come back as they were, to the last bit."""
    raster, sheets = yardstick.grid.raster, yardstick.grid.sheets
    arrays: dict[str, npt.NDArray[Any]] = {
        "edges": np.concatenate([np.zeros((0, 2)), *yardstick.edges_map]),
        "num_edges": np.array([len(edges) for edges in yardstick.edges_map], dtype=np.int64),
        "resolutions_m": np.array(yardstick.resolutions_m),
        "objective_floor": np.array(yardstick.objective_floor),
        "raster": np.array([raster.x_min_m, raster.y_min_m, raster.cell_m]),
        "shapes": np.array([(raster.rows, raster.cols), *(sheet.marks.shape for sheet in sheets)]),
        "sheet_resolutions_m": np.array([sheet.resolution_m for sheet in sheets]),
        "T_map_sheet": np.array([sheet.T_map_sheet for sheet in sheets]).reshape(-1, 3, 3),
        "walls": np.packbits(np.concatenate([yardstick.grid.walls.ravel(), *(_cells(s, OCCUPIED) for s in sheets)])),
        "free": np.packbits(np.concatenate([yardstick.grid.free.ravel(), *(_cells(s, FREE) for s in sheets)])),
    }
    file = io.BytesIO()
    np.savez(file, **arrays)  # type: ignore[arg-type]  # its stub takes "allow_pickle" for one of the arrays
    return file.getvalue()


def read_yardstick(path: Path, truth: Truth) -> Yardstick | None:
    """A yardstick that was written, for the truth of its dataset; none where there is no sound file."""
    try:
        with np.load(path) as file:
            arrays = dict(file)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    ends = np.cumsum(arrays["num_edges"])[:-1]
    return Yardstick(
        truth=truth,
        edges_map=tuple(np.split(arrays["edges"], ends)),
        resolutions_m=tuple(arrays["resolutions_m"].tolist()),
        grid=_grid(arrays, truth),
        objective_floor=float(arrays["objective_floor"]),
    )


def _cells(sheet: Sheet, mark: int) -> Mask:
    return np.asarray(sheet.marks == mark).ravel()


def _grid(arrays: dict[str, npt.NDArray[Any]], truth: Truth) -> TrueGrid:
    shapes = arrays["shapes"].tolist()
    walls, free = (_split(arrays[name], shapes) for name in ("walls", "free"))
    places = zip(walls[1:], free[1:], arrays["sheet_resolutions_m"].tolist(), arrays["T_map_sheet"], strict=True)
    sheets = [
        Sheet(w.view(np.uint8) * np.uint8(OCCUPIED) | f.view(np.uint8) * np.uint8(FREE), m, T) for w, f, m, T in places
    ]
    raster = Raster(*arrays["raster"].tolist(), *shapes[0])
    return TrueGrid(tuple(sheets), truth.T_world_map, raster, walls[0], free[0])


def _split(bits: npt.NDArray[np.uint8], shapes: list[list[int]]) -> list[Mask]:
    """Masks of these shapes from their bits, one after the other."""
    sizes = [rows * cols for rows, cols in shapes]
    cells = np.unpackbits(bits, count=sum(sizes)).view(np.bool_)
    parts = np.split(cells, np.cumsum(sizes)[:-1])
    return [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
