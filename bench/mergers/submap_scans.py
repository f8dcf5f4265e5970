"""A dataset's scans by submap, for methods that start from scans: one CARMEN log a map, in the map's own frame.

A log shows what its map was made from and no more: ranges, and the poses with which the map was made (a scan of two
maps has the pose that the first of them gave it). Where the map lies in the world it does not say.
"""

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.maps.truth import read_truth
from sim.recordings.carmen import read_carmen
from sim.recordings.tum import read_tum
from sim.robot_run import RobotRun

_STAMP_S = 1e-6
_BEYOND_M = 0.01


def write_submap_scans(dataset: Path, folder: Path) -> None:
    """Write ``NAME.log`` for every map of a dataset: ``ODOM`` and ``FLASER`` lines in the order of time.

    All poses of a line are ``T_map_lidar`` in the frame of the map's YAML; no return is 1 cm beyond the lidar's range.
    The head says the beam step, the first angle (both degrees) and the range, as ``PARAM`` lines.

    Args:
        dataset: A dataset folder.
        folder: An existing folder.
    """
    runs = {run.trajectory.robot: run for run in read_carmen(dataset / "scans.log")}
    truth = read_truth(dataset / "truth.json")
    for k, name in enumerate(truth.names):
        run = runs[truth.robot[k]]
        stamps_s, T_world_robot = read_tum(dataset / "trajectories" / f"{truth.robot[k]}_estimate.tum")
        inside = (stamps_s >= truth.start_s[k] - _STAMP_S) & (stamps_s <= truth.end_s[k] + _STAMP_S)
        scans = np.argsort(run.trajectory.stamps_s, kind="stable")[inside]  # trajectories on disk are in time order
        T_map_lidar = se2.invert(truth.T_world_map[k]) @ T_world_robot[inside] @ run.lidar.pose_on_robot
        lines = [*_head(run), *_scan_lines(run, scans, T_map_lidar)]
        (folder / f"{name}.log").write_text("\n".join(lines) + "\n", encoding="ascii")


def _head(run: RobotRun) -> list[str]:
    values = {
        "robot_front_laser_max": run.lidar.range_max_m + _BEYOND_M,
        "laser_front_laser_resolution": math.degrees(run.lidar.angle_increment_rad),
        "laser_front_laser_start_angle": math.degrees(run.lidar.angle_min_rad),
    }
    return [f"PARAM {key} {value:.9g} nohost 0" for key, value in values.items()]


def _scan_lines(run: RobotRun, scans: npt.NDArray[np.int64], T_map_lidar: npt.NDArray[np.float64]) -> list[str]:
    lines = []
    for scan, pose in zip(scans.tolist(), se2.parameters_of(T_map_lidar).tolist(), strict=True):
        ranges = run.read_ranges(scan, scan + 1)[0]
        readings = np.where(np.isposinf(ranges), run.lidar.range_max_m + _BEYOND_M, np.nan_to_num(ranges, neginf=0.0))
        place = " ".join(f"{value:.9f}" for value in pose)
        end = f"{run.trajectory.stamps_s[scan]:.6f} robot {run.trajectory.stamps_s[scan]:.6f}"
        text = " ".join(f"{value:.4f}" for value in readings)
        lines += [f"ODOM {place} 0 0 0 {end}", f"FLASER {len(readings)} {text} {place} {place} {end}"]
    return lines
