"""What is laid on a canvas lies where its place in the world says, at every scale."""

import cv2
import numpy as np
import pytest

from merger import se2
from merger.grid_map import GridMap
from sim.datasets.canvas import finish_page, lay_cells, make_canvas, make_colours

BLACK = (0.0, 0.0, 0.0)
PACK = np.array([1, 256, 65536])
"""Makes one number of a colour."""


def room(width_m: float, height_m: float, resolution_m: float) -> GridMap:
    """A free floor with walls of three cells around it."""
    cells = np.full((round(height_m / resolution_m), round(width_m / resolution_m)), -5.0, dtype=np.float32)
    cells[:3], cells[-3:], cells[:, :3], cells[:, -3:] = 5.0, 5.0, 5.0, 5.0
    return GridMap("room", cells, resolution_m)


def darkness_at(canvas, points):
    """(N,) how black the pixels are that hold points of the world, 0 to 1."""
    x, y = np.floor(se2.transform_points(canvas.T_px_world, points)).astype(int).T
    return 1.0 - canvas.pixels[0, y, x] / 255.0


@pytest.mark.parametrize(("size_m", "cell_m"), [((9.0, 6.0), 0.05), ((70.0, 45.0), 0.05), ((200.0, 3.0), 0.1)])
def test_cells_lie_where_the_maps_place_says(size_m, cell_m):
    building = room(*size_m, cell_m)
    canvas = make_canvas(building)
    T_world_map = se2.make_motion(1.0, -0.5, 0.02)
    moved = GridMap("moved", building.log_odds, cell_m, se2.invert(T_world_map))
    lay_cells(canvas, moved, T_world_map, BLACK, (1.0, 0.25))
    walls = building.log_odds > 0.0
    inside = np.zeros_like(walls)
    inside[6:-6:4, 6:-6:4] = True
    assert np.abs(darkness_at(canvas, building.cell_centers(inside)) - 0.25).max() < 0.02
    middle = np.zeros_like(walls)
    middle[1, 1:-1] = middle[-2, 1:-1] = middle[1:-1, 1] = middle[1:-1, -2] = True
    assert (darkness_at(canvas, building.cell_centers(middle)) > 0.6).all()


def test_what_was_never_seen_stays_as_it_was():
    canvas = make_canvas(room(5.0, 4.0, 0.05))
    lay_cells(canvas, GridMap("unknown", np.zeros((50, 50), dtype=np.float32), 0.1), np.eye(3), BLACK, (1.0, 1.0))
    assert (canvas.pixels == 255.0).all()


def test_a_map_without_a_seen_cell_has_a_canvas_too():
    assert make_canvas(GridMap("nothing", np.zeros((1, 1), dtype=np.float32), 0.05)).pixels.size > 0


@pytest.mark.parametrize("size_m", [(5.0, 4.0), (60.0, 1.0), (1.0, 60.0)])
def test_a_page_shows_the_canvas_and_has_room_for_every_name(size_m):
    canvas = make_canvas(room(*size_m, 0.05))
    image = np.full((*canvas.size_px, 3), 200, dtype=np.uint8)
    legend = [(f"map_{k}", colour) for k, colour in enumerate(make_colours(60))]
    page = cv2.imdecode(np.frombuffer(finish_page(canvas, image, legend), np.uint8), cv2.IMREAD_COLOR)
    packed = page.astype(np.int64) @ PACK
    assert (packed == 200 * PACK.sum()).sum() >= 0.99 * image[..., 0].size
    assert np.isin([np.rint(colour) @ PACK for _, colour in legend], packed).all()


def test_colours_differ():
    colours = np.array(make_colours(40))
    away = np.linalg.norm(colours[:, None] - colours[None], axis=-1) + 1e3 * np.eye(len(colours))
    assert away.min() > 10.0
