"""The true map of a building, its pictures, and templates of messages."""

import cv2
import numpy as np
import pytest

from merger import se2
from sim.buildings.building_map import draw_building
from sim.buildings.plan import Material
from sim.buildings.world import World
from sim.datasets.canvas import make_colours
from sim.datasets.figures import draw_overview, draw_world
from sim.recordings.message_template import fill_template, find_values


def box_world() -> World:
    """A room of 4 x 3 m, its corner at (1, 2), and a closed closet in it."""
    walls = []
    for x0, y0, x1, y1 in ((1.0, 2.0, 5.0, 5.0), (2.0, 3.0, 3.0, 4.0)):
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        walls += [np.stack([corners[k], corners[(k + 1) % 4]]) for k in range(4)]
    segments = np.stack(walls)
    return World("box", segments, np.full(len(segments), Material.WALL, np.int8), np.array([[1.5, 2.5, 0.0]]))


def test_surfaces_are_occupied_the_floor_is_free_and_the_rest_is_unknown():
    grid = draw_building(box_world(), 0.05)

    def at(x: float, y: float) -> str:
        row, col = np.floor(grid.cells_from_points_map(np.array([[x, y]]))[0]).astype(int)
        return "occupied" if grid.occupied[row, col] else "free" if grid.free[row, col] else "unknown"

    assert [at(1.51, 2.01), at(5.01, 3.0), at(2.5, 3.01)] == ["occupied"] * 3
    assert at(4.5, 4.5) == "free"
    assert at(2.5, 3.5) == "unknown"
    assert at(0.9, 2.0) == "unknown"
    assert grid.free.sum() * 0.05**2 == pytest.approx(4 * 3 - 1, rel=0.06)


def test_every_occupied_cell_holds_a_surface():
    grid = draw_building(box_world(), 0.05)
    x, y = grid.cell_centers(grid.occupied).T
    outer = np.abs(np.maximum(np.abs(x - 3.0) - 2.0, np.abs(y - 3.5) - 1.5))
    inner = np.abs(np.maximum(np.abs(x - 2.5) - 0.5, np.abs(y - 3.5) - 0.5))
    assert np.minimum(outer, inner).max() <= 0.05


def test_pictures_show_each_map_in_a_colour_of_its_own_at_its_true_place(tmp_path, make_runs):
    grid = draw_building(box_world(), 0.05)
    draw_world(tmp_path / "world.png", grid, [run.trajectory for run in make_runs(num_robots=2)])
    draw_overview(tmp_path / "overview.png", grid, [grid, grid], np.stack([np.eye(3), se2.make_motion(0.5, 0.5, 0.3)]))
    for name in ("world.png", "overview.png"):
        assert min(cv2.imread(str(tmp_path / name)).shape[:2]) > 300
    pixels = cv2.imread(str(tmp_path / "overview.png")).astype(int)
    for colour in make_colours(2):
        assert (np.abs(pixels - np.array(colour)).max(axis=-1) < 40).sum() > 1000


def test_a_template_is_filled_with_values_where_the_marks_stood():
    template = find_values(b"ab12cd5678", [b"12", b"5678"])
    values = [np.array([[1, 2], [3, 4]], dtype=np.uint8), np.array([7, 8], dtype="<u4")]
    assert fill_template(template, values) == [b"ab\x01\x02cd\x07\0\0\0", b"ab\x03\x04cd\x08\0\0\0"]


@pytest.mark.parametrize("mark", [b"xx", b"aa"])
def test_a_mark_that_is_missing_or_stands_twice_is_refused(mark):
    with pytest.raises(ValueError, match="must stand once"):
        find_values(b"aabaab", [mark])
