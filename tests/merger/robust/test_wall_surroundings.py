"""What the cells about wall cells tell, beside a slow way to find it."""

import numpy as np
import pytest

from merger.robust import wall_surroundings
from merger.robust.wall_surroundings import describe_surroundings, sum_windows

POWERS = ((0, 0), (1, 0), (0, 2), (1, 1))


@pytest.mark.parametrize("cells_at_once", [1, 200, 10**6])
def test_sums_over_windows_agree_with_a_slow_oracle(monkeypatch, cells_at_once):
    monkeypatch.setattr(wall_surroundings, "_CELLS_AT_ONCE", cells_at_once)
    mask = np.random.default_rng(0).random((17, 23)) < 0.3
    rows, cols = np.nonzero(mask)
    slow = np.zeros((len(POWERS), len(rows)))
    for k, (row, col) in enumerate(zip(rows, cols, strict=True)):
        for other_row, other_col in zip(rows, cols, strict=True):
            dx, dy = other_col - col, other_row - row
            if max(abs(dx), abs(dy)) <= 3:
                slow[:, k] += [dx**p * dy**q for p, q in POWERS]
    assert sum_windows(mask, (rows, cols), 3, POWERS) == pytest.approx(slow)


def test_a_straight_wall_is_a_line_that_faces_its_free_side():
    wall, free = np.zeros((30, 30), dtype=np.bool_), np.zeros((30, 30), dtype=np.bool_)
    wall[15], free[16:] = True, True
    about = describe_surroundings(wall, free, (np.array([15]), np.array([12])), 5.0)
    assert np.abs(about.normals[0]) == pytest.approx([0.0, 1.0])
    assert about.linearity[0] == pytest.approx(1.0)
    assert about.facing[0] == pytest.approx([0.0, 1.0])
    assert about.num_cells[0] == 11.0
