"""Ranges are cast once, are the same however they are read, and are not kept where they would fill the memory."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from merger import se2
from sim.robot_run import LidarSpec, RobotRun, Trajectory
from sim.sensors.range_store import keep_ranges

_NUM_SCANS, _NUM_BEAMS = 1000, 7
_RANGES_M = np.arange(_NUM_SCANS * _NUM_BEAMS, dtype=np.float32).reshape(_NUM_SCANS, _NUM_BEAMS)
_BYTES = 4 * _NUM_SCANS * _NUM_BEAMS


def _run_that_counts() -> tuple[RobotRun, npt.NDArray[np.int64]]:
    """A run of known ranges, and how often each of its scans has been cast."""
    times_cast = np.zeros(_NUM_SCANS, dtype=np.int64)

    def cast(start: int, stop: int) -> npt.NDArray[np.float32]:
        times_cast[start:stop] += 1
        return _RANGES_M[start:stop].copy()

    T = np.tile(se2.make_motion(0.0, 0.0, 0.0), (_NUM_SCANS, 1, 1))
    trajectory = Trajectory("robot_0", np.arange(_NUM_SCANS) * 0.1, T, T)
    return RobotRun(trajectory, LidarSpec(_NUM_BEAMS, 0.0, 0.1, 0.1, 10.0), cast), times_cast


@given(st.lists(st.tuples(st.integers(0, _NUM_SCANS), st.integers(0, _NUM_SCANS)), max_size=6))
def test_however_reading_is_cut_each_scan_is_cast_at_most_once_and_reads_the_same(cuts: list[tuple[int, int]]) -> None:
    run, times_cast = _run_that_counts()
    kept = keep_ranges(run, _BYTES)
    for start, stop in [*cuts, (0, _NUM_SCANS)]:
        if start <= stop:
            assert np.array_equal(kept.read_ranges(start, stop), _RANGES_M[start:stop])
    assert (times_cast == 1).all()


def test_a_scan_that_is_never_read_does_not_cost_the_whole_run() -> None:
    run, times_cast = _run_that_counts()
    keep_ranges(run, _BYTES).read_ranges(700, 701)
    assert 1 <= times_cast.sum() < _NUM_SCANS / 2


def test_a_run_beyond_the_memory_is_cast_each_time() -> None:
    run, times_cast = _run_that_counts()
    kept = keep_ranges(run, _BYTES - 1)
    for _ in range(2):
        assert np.array_equal(kept.read_ranges(0, _NUM_SCANS), _RANGES_M)
    assert (times_cast == 2).all()


def test_nothing_but_the_reading_changes() -> None:
    run, _ = _run_that_counts()
    kept = keep_ranges(run, _BYTES)
    assert replace(kept, read_ranges=run.read_ranges) == run
