"""Ranges that are cast once and kept: maps, log and recording read every scan of a run again."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from sim.robot_run import ReadRanges, RobotRun

_BLOCK_SCANS = 256
"""Scans that are cast together when one of them is first read."""


def keep_ranges(run: RobotRun, most_bytes: int) -> RobotRun:
    """The same run, whose ranges are cast when they are first read, and kept.

    Args:
        run: Its ranges are the same however it is cut into calls.
        most_bytes: A run whose ranges need more than this is not kept, but cast each time, so that memory stays small.
    """
    num_bytes = run.num_scans * run.lidar.num_beams * np.dtype(np.float32).itemsize
    if num_bytes > most_bytes:
        return run
    return replace(run, read_ranges=_RangeStore(run.read_ranges, run.num_scans, run.lidar.num_beams).read)


class _RangeStore:
    """The ranges of a run, block by block; threads that want the same block at once write the same values."""

    def __init__(self, cast: ReadRanges, num_scans: int, num_beams: int) -> None:
        self._cast = cast
        self._ranges_m = np.empty((num_scans, num_beams), dtype=np.float32)
        self._known = np.zeros(-(-num_scans // _BLOCK_SCANS), dtype=np.bool_)

    def read(self, start: int, stop: int) -> npt.NDArray[np.float32]:
        """(stop - start, num_beams) ranges in metres; not to be changed."""
        for block in range(start // _BLOCK_SCANS, -(-stop // _BLOCK_SCANS)):
            if not self._known[block]:
                first = block * _BLOCK_SCANS
                last = min(first + _BLOCK_SCANS, len(self._ranges_m))
                self._ranges_m[first:last] = self._cast(first, last)
                self._known[block] = True
        return self._ranges_m[start:stop]
