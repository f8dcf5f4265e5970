"""Trajectories in TUM's format."""

import numpy as np
import pytest

from merger import se2
from sim.recordings.tum import read_tum, write_tum


def test_poses_are_written_in_the_order_of_time_with_nine_decimals(tmp_path):
    T = se2.make_motion([1.0, 2.0, 3.0], [0.123456789, 5.0, 6.0], [0.5, -3.0, 3.1])
    write_tum(tmp_path / "x.tum", np.array([2.0, 0.25, 1.0]), T)
    lines = (tmp_path / "x.tum").read_text().splitlines()
    assert lines[3].startswith("2.000000000 1.000000000 0.123456789 0 0 0 ")
    stamps, back = read_tum(tmp_path / "x.tum")
    assert stamps.tolist() == [0.25, 1.0, 2.0]
    assert np.allclose(back, T[[1, 2, 0]], atol=1e-8)


def test_a_line_that_is_not_eight_numbers_is_refused(tmp_path):
    (tmp_path / "x.tum").write_text("0 1 2\n")
    with pytest.raises(ValueError, match="8 numbers, got 3"):
        read_tum(tmp_path / "x.tum")
