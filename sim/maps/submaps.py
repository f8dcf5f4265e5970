"""Which scans make which submap, and the frame that each submap is given."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2

_FARTHEST_M = 10_000.0
"""Farther from its frame's origin a map's coordinates lose their last millimetres in some tools."""


@dataclass(frozen=True)
class SubmapsConfig:
    """How runs are cut into submaps."""

    count: int | None = None
    """Submaps of the whole dataset, shared among the robots by their numbers of scans; none: what the world's file
    says, 8 for a log."""
    overlap: float = 0.3
    """Share of its scans that a submap has in common with the next one of its robot, in [0, 0.9]."""
    measured_overlap: float | None = None
    """In place of ``overlap``: the share of walls that every two neighbouring submaps are to have in common, in (0, 1);
    see `sim.maps.overlap_search`."""
    shift_m: float = 10.0
    """A submap's frame is shifted from its first pose by up to this, along x and y, at random; in [0, 10000]."""
    turn_deg: float = 180.0
    """A submap's frame is turned from its first pose by up to this, at random; in [0, 180]."""

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        if self.count is not None and self.count < 1:
            raise ValueError(f"submaps.count must be >= 1, got {self.count}")
        if not 0.0 <= self.overlap <= 0.9:
            raise ValueError(f"submaps.overlap must be in [0, 0.9], got {self.overlap}")
        if self.measured_overlap is not None and not 0.0 < self.measured_overlap < 1.0:
            raise ValueError(f"submaps.measured_overlap must be in (0, 1), got {self.measured_overlap}")
        if not 0.0 <= self.shift_m <= _FARTHEST_M:
            raise ValueError(f"submaps.shift_m must be in [0, {_FARTHEST_M:g}], got {self.shift_m}")
        if not 0.0 <= self.turn_deg <= 180.0:
            raise ValueError(f"submaps.turn_deg must be in [0, 180], got {self.turn_deg}")


@dataclass(frozen=True)
class SubmapCut:
    """The scans of one submap."""

    name: str
    """``map_00``, ``map_01``, ..."""
    robot: int
    """Index of the robot among the runs."""
    start: int
    """First scan."""
    stop: int
    """One past the last scan."""


def cut_submaps(num_scans: Sequence[int], count: int, overlap: float) -> list[SubmapCut]:
    """Cut each robot's scans, in their order, into parts of equal length that overlap.

    A robot of n scans and k parts gets parts of ``n / (1 + (k - 1)(1 - overlap))`` scans, rounded: neighbours share
    the fraction ``overlap`` of a part, the first starts at the first scan, and the last ends at the last.

    Args:
        num_scans: Scans of each robot.
        count: Submaps of all robots together.
        overlap: Share of a part that is also in the next one, below 1; below 0, scans between parts are left out.

    Returns:
        The cuts, robot by robot.

    Raises:
        ValueError: fewer submaps than robots, or more than scans.
    """
    if not len(num_scans) <= count <= sum(num_scans):
        raise ValueError(
            f"submaps.count must be between the number of robots, {len(num_scans)}, "
            f"and the number of scans, {sum(num_scans)}, got {count}"
        )
    cuts: list[SubmapCut] = []
    for robot, parts in enumerate(_share_out(num_scans, count)):
        length = num_scans[robot] / (1.0 + (parts - 1) * (1.0 - overlap))
        for part in range(parts):
            first = part * length * (1.0 - overlap)
            start, stop = round(first), min(round(first + length), num_scans[robot])
            cuts.append(SubmapCut(f"map_{len(cuts):02d}", robot, start, max(stop, start + 1)))
    return cuts


def draw_submap_frame(config: SubmapsConfig, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """The (3, 3) pose ``T_map_robot`` of the first scan in a submap's own frame: any place, any heading."""
    x, y = rng.uniform(-config.shift_m, config.shift_m, 2)
    turn = math.radians(config.turn_deg)
    return se2.make_motion(x, y, rng.uniform(-turn, turn))


def _share_out(num_scans: Sequence[int], count: int) -> list[int]:
    """Parts of each robot: one each, then always one to the robot whose parts are longest (the first of equals)."""
    parts = [1] * len(num_scans)
    for _ in range(count - len(num_scans)):
        lengths = [n / k if k < n else 0.0 for n, k in zip(num_scans, parts, strict=True)]
        parts[int(np.argmax(lengths))] += 1
    return parts
