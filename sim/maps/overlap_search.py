"""Cuts by what matters: submaps whose neighbours see a given share of the same walls, however many scans that takes."""

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sim.maps.mapping import OccupancyConfig
from sim.maps.seen_walls import SeenWalls, find_seen_walls, overlap_of
from sim.maps.submap_mapping import SubmapResult
from sim.maps.submaps import SubmapCut, cut_submaps
from sim.maps.truth import align_poses, overlap_fractions
from sim.robot_run import RobotRun

MapPart = Callable[[int, SubmapCut], SubmapResult]
"""Maps the k-th submap as it will be in the dataset."""

TOLERANCE = 0.03
"""How far overlaps may be from what was asked for."""
_NEAR_ENOUGH = 0.01
"""A part is not mapped again when its overlap is this near."""
_MAX_MAPPINGS = 6
"""How often a part is mapped at most."""
_SHARES = (0.9, 0.7, 0.5, 0.3, 0.1, -0.2, -0.6, -1.2, -2.0)
"""Shares of common scans (below zero: left out) of the equal parts that the search begins with."""
_STRETCHES = (0.0, -0.1, 0.1, -0.2, 0.25, -0.35, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0, 1.5, -1.5, 2.0, -2.0)
"""What a part is longer than its equal share, as a share of it: where a robot comes back, another end may do."""
_SHORTEST = 0.25
"""Least length of a part, as a share of the equal one."""
_FIRST_SHARES = (1.0, 0.7, 0.4)
"""Lengths of a robot's first part that are tried, over the equal one."""
_BLOCKS_PER_PART = 60
"""Blocks of scans for each part; what a part sees is known from block to block."""
_STARTS = 30
"""First scans that are tried for each last one."""


@dataclass(frozen=True)
class _Part:
    """A part that was mapped."""

    cut: SubmapCut
    """Its scans."""
    submap: SubmapResult
    """Its map."""
    T_world_map: npt.NDArray[np.float64]
    """(3, 3) its true place."""
    overlap: float
    """With the part before it; NaN for a robot's first."""


@dataclass(frozen=True)
class _Robot:
    """A robot's run, and the walls that its parts would see."""

    run: RobotRun
    walls: SeenWalls


def find_cuts(
    runs: Sequence[RobotRun], count: int, target: float, occupancy: OccupancyConfig, map_part: MapPart
) -> list[SubmapCut]:
    """Cut runs so that every two neighbouring submaps overlap by a given amount, as measured in their maps.

    From a robot's first part on, each next one begins where its overlap with the one before is as wanted: parts may
    differ in length, and scans between them may be left out. Where to look is told by the walls that a part would see
    (`sim.maps.seen_walls`); then it is mapped, and what both differ by is made up for, a few times. Where no part will
    do, the nearest is taken, as long as the mean is met; `sim.maps.missed_overlaps` tells of it. Overlap of
    neighbours: the mean of both directions of `sim.maps.truth.overlap_fractions`.

    Args:
        runs: The runs of all robots.
        count: Submaps of all robots together.
        target: Wanted overlap, in (0, 1).
        occupancy: How scans become cells.
        map_part: Maps a part.

    Raises:
        ValueError: the mean over all neighbours is not within 0.03 of the target, or there are no neighbours.
    """
    robots = [_Robot(run, find_seen_walls(run, occupancy, _BLOCKS_PER_PART * count)) for run in runs]
    numbered = enumerate(_cut_equally(robots, count, target))
    parts: list[_Part] = []
    for robot, nominal in itertools.groupby(numbered, key=lambda item: item[1].robot):
        parts += _find_chain(robots[robot], list(nominal), target, map_part)
    overlaps = [part.overlap for part in parts if not math.isnan(part.overlap)]
    if not overlaps:
        raise ValueError(
            f"submaps.measured_overlap={target:g} needs neighbours, and {count} submaps of {len(runs)} runs have none"
        )
    measured = float(np.mean(overlaps))
    if not abs(measured - target) <= TOLERANCE:
        raise ValueError(
            f"submaps.measured_overlap={target:g} cannot be met with {count} submaps: the nearest is {measured:.2f}"
        )
    return [part.cut for part in parts]


def _cut_equally(robots: Sequence[_Robot], count: int, target: float) -> list[SubmapCut]:
    """Parts of equal length, whose neighbours are expected to overlap most nearly by so much."""
    num_scans = [robot.run.num_scans for robot in robots]
    trials = [cut_submaps(num_scans, count, share) for share in _SHARES]
    return min(trials, key=lambda cuts: abs(_expect_overlap(robots, cuts) - target))


def _expect_overlap(robots: Sequence[_Robot], cuts: Sequence[SubmapCut]) -> float:
    """Mean overlap of neighbours, by the walls that they would see; 0 where there are none."""
    values = [
        overlap_of(*(robots[cut.robot].walls.mask(cut.start, cut.stop) for cut in pair))
        for pair in itertools.pairwise(cuts)
        if pair[0].robot == pair[1].robot
    ]
    return float(np.mean(values)) if values else 0.0


def _find_chain(
    robot: _Robot, nominal: Sequence[tuple[int, SubmapCut]], target: float, map_part: MapPart
) -> list[_Part]:
    """The parts of a robot: where a pair comes out wrong, shorter first parts are tried, and the best is taken."""
    chains: list[list[_Part]] = []
    for share in _FIRST_SHARES:
        first = nominal[0][1]
        shorter = replace(first, stop=first.start + max(round(share * (first.stop - first.start)), 1))
        parts = [_map(robot, None, shorter, functools.partial(map_part, nominal[0][0]))]
        for k, cut in nominal[1:]:
            parts.append(_fit(robot, parts[-1], cut, target, functools.partial(map_part, k)))
        chains.append(parts)
        if _miss(parts, target) <= TOLERANCE:
            break
    return min(chains, key=lambda chain: _miss(chain, target))


def _miss(chain: Sequence[_Part], target: float) -> float:
    """How far the worst pair of a chain is from the target; 0 without pairs."""
    return max((abs(part.overlap - target) for part in chain[1:]), default=0.0)


def _fit(
    robot: _Robot, before: _Part, nominal: SubmapCut, target: float, map_cut: Callable[[SubmapCut], SubmapResult]
) -> _Part:
    """The part that follows a part and overlaps it most nearly by so much."""
    tried: dict[SubmapCut, _Part] = {}
    wanted = target
    for _ in range(_MAX_MAPPINGS):
        cut, expected = _propose(robot.walls, before.cut, nominal, wanted)
        if cut in tried:
            break
        tried[cut] = _map(robot, before, cut, map_cut)
        if abs(tried[cut].overlap - target) <= _NEAR_ENOUGH:
            break
        wanted = expected + target - tried[cut].overlap
    return min(tried.values(), key=lambda part: abs(part.overlap - target))


def _map(robot: _Robot, before: _Part | None, cut: SubmapCut, map_cut: Callable[[SubmapCut], SubmapResult]) -> _Part:
    """Map a part and measure its overlap with the one before."""
    submap = map_cut(cut)
    T_world_map, _ = align_poses(robot.run.trajectory.T_world_robot[cut.start : cut.stop], submap.T_map_robot)
    if before is None:
        return _Part(cut, submap, T_world_map, float("nan"))
    fraction = overlap_fractions([before.submap.grid, submap.grid], np.stack([before.T_world_map, T_world_map]))
    return _Part(cut, submap, T_world_map, float(fraction[0, 1] + fraction[1, 0]) / 2.0)


def _propose(walls: SeenWalls, before: SubmapCut, nominal: SubmapCut, wanted: float) -> tuple[SubmapCut, float]:
    """The part that is expected to overlap the one before by so much, and what is expected of it.

    Of the ends that allow for it the one nearest to the equal part's; else the part that comes nearest.
    """
    length = nominal.stop - nominal.start
    shortest, latest = max(round(_SHORTEST * length), 1), nominal.stop + (walls.num_scans - nominal.stop) // 2
    seen = walls.mask(before.start, before.stop)
    nearest = (replace(nominal, start=max(nominal.start, before.start + 1)), math.inf)
    for stretch in _STRETCHES:
        stop = min(nominal.stop + round(stretch * length), latest)
        starts = np.unique(np.linspace(before.start + 1, stop - shortest, _STARTS).round().astype(np.int64))
        if stop - shortest <= before.start:
            continue
        expected = np.array([overlap_of(seen, walls.mask(int(start), stop)) for start in starts])
        start = _cross(starts, expected, wanted, nominal.start)
        cut = replace(nominal, start=start, stop=stop)
        found = overlap_of(seen, walls.mask(start, stop))
        if abs(found - wanted) < abs(nearest[1] - wanted):
            nearest = (cut, found)
        if abs(found - wanted) <= _NEAR_ENOUGH:
            break
    return nearest


def _cross(starts: npt.NDArray[np.int64], expected: npt.NDArray[np.float64], wanted: float, nominal: int) -> int:
    """The start at which what is expected crosses what is wanted, the nearest to the equal part's; else the nearest."""
    over = expected > wanted
    crossings = np.flatnonzero(over[:-1] != over[1:])
    if not len(crossings):
        return int(starts[np.argmin(np.abs(expected - wanted))])
    k = crossings[np.argmin(np.abs(starts[crossings] - nominal))]
    share = (expected[k] - wanted) / (expected[k] - expected[k + 1])
    return round(float(starts[k] + share * (starts[k + 1] - starts[k])))
