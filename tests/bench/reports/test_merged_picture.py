"""Maps laid over each other: every pixel shows what lies at its place."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bench.reports.merged_picture import draw_merge, frame_of
from bench.reports.png import MOST_COLOURS, PaletteImage, encode_png
from merger import se2
from merger.grid_map import GridMap
from sim.datasets.dataset import Dataset


def paint_slowly(maps: list[GridMap], T_world_map: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Whose wall lies on top, pixel by pixel, -1 for nobody's; walls are widened by a pixel up and right."""
    walls = np.full(centres.shape[:2], -1)
    for k, (grid, T) in enumerate(zip(maps, T_world_map, strict=True)):
        places = se2.transform_points(se2.invert(T @ grid.T_map_grid), centres.reshape(-1, 2)) / grid.resolution_m
        col, row = np.floor(places).astype(int).T
        inside = (row >= 0) & (row < grid.occupied.shape[0]) & (col >= 0) & (col < grid.occupied.shape[1])
        hit = np.zeros(len(places), dtype=bool)
        hit[inside] = grid.occupied[row[inside], col[inside]]
        hit = hit.reshape(walls.shape)
        wide = hit.copy()
        wide[1:] |= hit[:-1]
        wide[:, 1:] |= wide[:, :-1].copy()
        walls[wide] = k
    return walls


@given(
    cells=arrays(np.uint8, st.tuples(st.integers(1, 20), st.integers(1, 20))),
    palette=arrays(np.uint8, (MOST_COLOURS, 4)),
)
def test_an_image_comes_back_from_its_png(cells: np.ndarray, palette: np.ndarray) -> None:
    data = np.frombuffer(encode_png(PaletteImage(cells, palette)), dtype=np.uint8)
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert (decoded == palette[cells][:, :, [2, 1, 0, 3]]).all()


@pytest.mark.parametrize("left_out", [None, 1])
def test_the_last_map_with_a_wall_at_a_place_is_seen_there(dataset: Dataset, left_out: int | None) -> None:
    maps, T = list(dataset.maps), dataset.truth.T_world_map.copy()
    raster = frame_of(maps, T)
    if left_out is not None:
        T[left_out] = np.nan
    picture = draw_merge(maps, T, raster).image
    image = picture.palette[picture.cells][::-1]
    y, x = np.mgrid[: raster.rows, : raster.cols]
    centres = np.stack([raster.x_min_m + (x + 0.5) * raster.cell_m, raster.y_min_m + (y + 0.5) * raster.cell_m], -1)
    shown = [k for k in range(len(maps)) if k != left_out]
    walls = paint_slowly([maps[k] for k in shown], T[shown], centres)
    seen = [np.unique(image[walls == n], axis=0) for n in range(len(shown))]
    assert [len(colours) for colours in seen] == [1] * len(shown)
    assert len(np.unique(np.concatenate(seen), axis=0)) == len(shown)
    assert (image[walls < 0][:, 3] < 255).all()


@pytest.mark.parametrize("distance_m", [1e3, 1e9, 1e300])
def test_a_map_far_outside_the_picture_is_not_seen(dataset: Dataset, distance_m: float) -> None:
    T_far, T_gone = (dataset.truth.T_world_map.copy() for _ in range(2))
    T_far[1] = se2.make_motion(-distance_m, distance_m, 1.0)
    T_gone[1] = np.nan
    raster = frame_of(dataset.maps, dataset.truth.T_world_map)
    far, gone = (draw_merge(dataset.maps, T, raster) for T in (T_far, T_gone))
    assert (far.image.cells == gone.image.cells).all()
    assert (far.num_outside, gone.num_outside) == (1, 0)
