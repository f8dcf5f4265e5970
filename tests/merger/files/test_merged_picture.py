"""The picture of a merge shows maps where and as large as they are."""

import numpy as np
import pytest

from merger.files.merged_picture import draw_merge, make_colours
from merger.grid_map import GridMap
from merger.result import MapPlacement


def wall(column: int) -> GridMap:
    """A wall at one column of 100."""
    cells = np.full((40, 100), -2.0, np.float32)
    cells[:, column] = 2.0
    return GridMap("a", cells, 0.1)


@pytest.mark.parametrize("scale", [None, 0.95, 1.05])
def test_a_wall_is_drawn_where_the_scale_of_its_map_puts_it(scale):
    placement = MapPlacement("a", True, 0, np.eye(3), scale=scale)
    picture = draw_merge(wall(10), [wall(80)], (placement,), "a")
    shown = picture[:, :420]  # the legend is at the right
    cols = np.nonzero((shown == np.array(make_colours(1)[0])).all(axis=-1))[1]
    assert np.median(cols) == pytest.approx(20 + 4 * 80.5 * (scale or 1.0), abs=3)
