"""One submap from a part of a run: poses by truth, odometry or scan matching, then an occupancy grid."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from sim.maps.mapping import OccupancyConfig, OccupancyMapper
from sim.maps.scan_skew import motion_per_beam
from sim.maps.submap_poses import PoseEstimationConfig, estimate_poses
from sim.robot_run import RobotRun

_CHUNK_SCANS = 256
"""Scans that are in memory at a time."""


class PoseSource(StrEnum):
    """Where the poses of a submap's scans come from."""

    TRUTH = "truth"
    """The true poses: a map without distortion."""
    ODOMETRY = "odometry"
    """Odometry alone: a map that drifts."""
    SCAN_MATCHED = "scan_matched"
    """Scan-to-map matching that starts from odometry: a map that bends as a real robot's does."""


@dataclass(frozen=True)
class MappingConfig:
    """How a submap is made."""

    poses: PoseSource = PoseSource.SCAN_MATCHED
    """Where the poses come from."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """How scans become cells."""
    estimation: PoseEstimationConfig = field(default_factory=PoseEstimationConfig)
    """How poses are estimated, where they are."""


@dataclass(frozen=True)
class SubmapResult:
    """A submap and the poses that it was made with."""

    grid: GridMap
    """The map; its cells are aligned with frame ``map``."""
    T_map_robot: npt.NDArray[np.float64]
    """(stop - start, 3, 3) estimated poses of the robot at the stamps of the part's scans."""


def map_submap(
    run: RobotRun, start: int, stop: int, config: MappingConfig, *, name: str, T_map_first: npt.NDArray[np.float64]
) -> SubmapResult:
    """Map the scans ``start`` to ``stop - 1`` of a run in a frame of their own.

    Args:
        run: The robot's run.
        start: First scan.
        stop: One past the last scan.
        config: Where the poses come from, and how scans become cells.
        name: Name of the map.
        T_map_first: (3, 3) pose in frame ``map`` of the robot at the first scan: it sets that frame.

    Raises:
        ValueError: there is no such part.
    """
    if not 0 <= start < stop <= run.num_scans:
        raise ValueError(f"submap '{name}': scans {start} to {stop} are not a part of a run of {run.num_scans} scans")
    T_map_robot = _poses_from_first(run, start, stop, config, T_map_first)
    mapper = OccupancyMapper(run.lidar, config.occupancy)
    _add_run(mapper, run, start, T_map_robot)
    return SubmapResult(mapper.grid(name), T_map_robot)


def map_ground_truth(runs: Sequence[RobotRun], config: OccupancyConfig, *, name: str = "map_ground_truth") -> GridMap:
    """Map all scans of all runs (one lidar model) at their true poses; the frame ``map`` is ``world``."""
    mapper = OccupancyMapper(runs[0].lidar, config)
    for run in runs:
        _add_run(mapper, run, 0, run.trajectory.T_world_robot)
    return mapper.grid(name)


def _poses_from_first(
    run: RobotRun, start: int, stop: int, config: MappingConfig, T_map_first: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """(stop - start, 3, 3) poses ``T_map_robot``."""
    if config.poses is PoseSource.SCAN_MATCHED:
        return T_map_first @ estimate_poses(run, start, stop, config.estimation, config.occupancy.max_range_m)
    if config.poses is PoseSource.TRUTH:
        poses = run.trajectory.T_world_robot[start:stop]
    else:
        poses = run.trajectory.T_odom_robot[start:stop]
    return np.asarray(T_map_first @ se2.invert(poses[0]) @ poses)


def _add_run(mapper: OccupancyMapper, run: RobotRun, start: int, T_map_robot: npt.NDArray[np.float64]) -> None:
    """Add the scans from ``start`` on to a map, some at a time."""
    stamps_s = run.trajectory.stamps_s[start : start + len(T_map_robot)]
    motions = motion_per_beam(T_map_robot @ run.lidar.pose_on_robot, stamps_s, run.lidar)
    for first in range(0, len(T_map_robot), _CHUNK_SCANS):
        poses = T_map_robot[first : first + _CHUNK_SCANS]
        ranges_m = run.read_ranges(start + first, start + first + len(poses))
        mapper.add_scans(ranges_m, poses, motions[first : first + _CHUNK_SCANS])
