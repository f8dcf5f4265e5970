"""What one robot brings home: its trajectory, its lidar, and its scans, computed or read when they are asked for."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2


@dataclass(frozen=True)
class LidarSpec:
    """Geometry of a 2D lidar; beam k points at ``angle_min_rad + k * angle_increment_rad`` in frame ``lidar``."""

    num_beams: int
    """Beams a scan, at least 1."""
    angle_min_rad: float
    """Angle of beam 0."""
    angle_increment_rad: float
    """Angle between neighbouring beams."""
    range_min_m: float
    """Nearest range that is measured; nearer is -inf (REP 117)."""
    range_max_m: float
    """Farthest range that is measured; no return is +inf (REP 117)."""
    scan_period_s: float = 0.1
    """Time between the first beams of two scans."""
    time_increment_s: float = 0.0
    """Time between two beams of one scan."""
    T_robot_lidar: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the lidar on the robot: x_m, y_m, theta_rad."""

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam: ``angle_min + angle_increment * (num_beams - 1)``."""
        return self.angle_min_rad + self.angle_increment_rad * (self.num_beams - 1)

    @property
    def angles_rad(self) -> npt.NDArray[np.float64]:
        """(num_beams,) angles of the beams in frame ``lidar``."""
        return self.angle_min_rad + self.angle_increment_rad * np.arange(self.num_beams, dtype=np.float64)

    @property
    def pose_on_robot(self) -> npt.NDArray[np.float64]:
        """(3, 3) motion ``T_robot_lidar``."""
        return se2.make_motion(*self.T_robot_lidar)


@dataclass(frozen=True)
class Trajectory:
    """Poses of one robot at the stamps of its scans."""

    robot: str
    """Name of the robot: ``robot_0``, ``robot_1``, ..."""
    stamps_s: npt.NDArray[np.float64]
    """(N,) time of each scan's first beam, seconds since the run began. Strictly increasing in simulated runs; real
    logs keep their file's order."""
    T_world_robot: npt.NDArray[np.float64]
    """(N, 3, 3) true poses."""
    T_odom_robot: npt.NDArray[np.float64]
    """(N, 3, 3) poses by odometry; the first one equals the identity."""

    @property
    def T_world_odom(self) -> npt.NDArray[np.float64]:
        """(3, 3) place of the frame in which odometry counts, if it is told the true pose at the start."""
        return np.asarray(self.T_world_robot[0] @ se2.invert(self.T_odom_robot[0]))


ReadRanges = Callable[[int, int], npt.NDArray[np.float32]]
"""``read(start, stop)`` gives the (stop - start, num_beams) ranges in metres of these scans, by REP 117 (+inf no
return, -inf too near, NaN invalid), the same values however a run is cut into calls."""


@dataclass(frozen=True)
class RobotRun:
    """One robot's run; memory stays small because scans come in chunks."""

    trajectory: Trajectory
    lidar: LidarSpec
    read_ranges: ReadRanges

    @property
    def num_scans(self) -> int:
        """Number of scans, N."""
        return len(self.trajectory.stamps_s)
