"""The poses of a submap's scans by scan matching: each scan against the map so far, then all keyframes jointly."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.maps.joint_alignment import JointAlignmentConfig, align_scans
from sim.maps.scan_matching import ScanMatcher, ScanMatchingConfig
from sim.maps.scan_skew import motion_per_beam
from sim.maps.scan_surfaces import find_surfaces, fit_normals
from sim.robot_run import LidarSpec, RobotRun
from sim.sensors.odometry import OdometryConfig

Array = npt.NDArray[np.float64]

_CHUNK_SCANS = 256
"""Scans that are in memory at a time."""
_FLOOR_M, _FLOOR_RAD = 0.01, 0.005
"""Odometry is never trusted beyond this."""


@dataclass(frozen=True)
class PoseEstimationConfig:
    """How the poses of a submap's scans are estimated.

    Raises:
        ValueError: a value is out of its range.
    """

    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    """How wheels are expected to err, at least: it sets where is searched."""
    matching: ScanMatchingConfig = field(default_factory=ScanMatchingConfig)
    """Each scan against the map so far."""
    joint: bool = True
    """Whether all keyframes are aligned jointly in the end."""
    alignment: JointAlignmentConfig = field(default_factory=JointAlignmentConfig)
    """How they are."""
    keyframe_m: float = 0.6
    """A scan is a keyframe when the robot has moved this far since the last one, > 0 ..."""
    keyframe_rad: float = 0.5
    """... or turned so far, > 0."""

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        for name in ("keyframe_m", "keyframe_rad"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"pose estimation: {name} must be > 0, got {getattr(self, name):g}")


def expect_odometry(config: PoseEstimationConfig, odometry: OdometryConfig) -> PoseEstimationConfig:
    """The settings for a robot whose wheels err so: nothing less than that is expected of them."""
    names = ("alpha1", "alpha2", "alpha3", "alpha4", "step_m")
    worse = {name: max(getattr(config.odometry, name), getattr(odometry, name)) for name in names}
    return replace(config, odometry=replace(config.odometry, **worse))


def estimate_poses(run: RobotRun, start: int, stop: int, config: PoseEstimationConfig, max_range_m: float) -> Array:
    """Poses of the robot at the scans ``start`` to ``stop - 1``, from odometry and ranges alone.

    Args:
        run: The robot's run.
        start: First scan.
        stop: One past the last scan.
        config: How.
        max_range_m: Longer ranges are not used.

    Returns:
        (stop - start, 3, 3) poses in a frame in which the first one is the identity.
    """
    T_robot_lidar = run.lidar.pose_on_robot
    T_odom_robot = run.trajectory.T_odom_robot[start:stop]
    T_odom_lidar = T_odom_robot @ T_robot_lidar
    sigmas = odometry_sigmas(se2.invert(T_odom_robot[:-1]) @ T_odom_robot[1:], config.odometry)
    sigmas = np.concatenate([np.full((1, 2), _FLOOR_M), sigmas])

    motions = motion_per_beam(T_odom_lidar, run.trajectory.stamps_s[start:stop], run.lidar)

    def read_surfaces(first: int, last: int) -> tuple[Array, npt.NDArray[np.bool_]]:
        ranges_m = run.read_ranges(start + first, start + last)
        return find_surfaces(ranges_m, run.lidar, max_range_m, motions[first:last])

    T_map_lidar = _match_in_turn(read_surfaces, T_odom_lidar, sigmas, config)
    if config.joint:
        keyframes = _choose_keyframes(T_map_lidar, config)
        surfaces = np.concatenate([fit_normals(*read_surfaces(k, k + 1), run.lidar) for k in keyframes])
        T_map_lidar = _align_keyframes(run.lidar, surfaces, keyframes, (T_map_lidar, T_odom_lidar, sigmas), config)
    return np.asarray(T_robot_lidar @ T_map_lidar @ se2.invert(T_robot_lidar))


def odometry_sigmas(T_before_after: Array, config: OdometryConfig) -> Array:
    """(S, 2) standard deviations, metres and radians, of (S, 3, 3) motions by odometry (see `sim.sensors.odometry`)."""
    x, y, turn = se2.parameters_of(T_before_after).T
    drive = np.hypot(x, y)
    turn_1 = np.arctan2(np.abs(y), np.abs(x))
    turns = 2.0 * turn_1 + np.abs(turn)
    variance_rad2 = config.step_m * (config.alpha1 * turns + 2.0 * config.alpha2 * drive)
    variance_m2 = config.step_m * (config.alpha3 * drive + config.alpha4 * turns) + drive**2 * variance_rad2 / 2.0
    return np.asarray(np.sqrt(np.stack([variance_m2 + _FLOOR_M**2, variance_rad2 + _FLOOR_RAD**2], axis=-1)))


def _match_in_turn(
    read_surfaces: Callable[[int, int], tuple[Array, npt.NDArray[np.bool_]]],
    T_odom_lidar: Array,
    sigmas: Array,
    config: PoseEstimationConfig,
) -> Array:
    """(S, 3, 3) poses of the lidar, the first one the identity."""
    matcher = ScanMatcher(config.matching, np.eye(3))
    motions = np.concatenate([np.eye(3)[None], se2.invert(T_odom_lidar[:-1]) @ T_odom_lidar[1:]])
    poses = []
    for first in range(0, len(motions), _CHUNK_SCANS):
        last = min(first + _CHUNK_SCANS, len(motions))
        poses.append(matcher.add_scans(read_surfaces(first, last), motions[first:last], sigmas[first:last]))
    return np.concatenate(poses)


def _choose_keyframes(T_map_lidar: Array, config: PoseEstimationConfig) -> npt.NDArray[np.int64]:
    """(K,) scans that stand for those around them; the first and the last one are among them."""
    poses = se2.parameters_of(T_map_lidar)
    chosen = [0]
    for k in range(1, len(poses)):
        x, y, theta = poses[k] - poses[chosen[-1]]
        turned = abs(float(se2.wrap_angle(theta)))
        if math.hypot(x, y) > config.keyframe_m or turned > config.keyframe_rad or k == len(poses) - 1:
            chosen.append(k)
    return np.array(chosen)


def _align_keyframes(
    lidar: LidarSpec,
    surfaces: Array,
    keyframes: npt.NDArray[np.int64],
    poses: tuple[Array, Array, Array],
    config: PoseEstimationConfig,
) -> Array:
    """(S, 3, 3) poses of the lidar after the keyframes' joint alignment; those between follow their neighbours."""
    T_map_lidar, T_odom_lidar, sigmas = poses
    steps = se2.invert(T_odom_lidar[keyframes[:-1]]) @ T_odom_lidar[keyframes[1:]]
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(sigmas**2, axis=0)])
    step_sigmas = np.sqrt(total[keyframes[1:] + 1] - total[keyframes[:-1] + 1])
    aligned = align_scans(surfaces, lidar, T_map_lidar[keyframes], (steps, step_sigmas), config.alignment)
    return _spread_corrections(T_map_lidar, keyframes, aligned)


def _spread_corrections(T_map_lidar: Array, keyframes: npt.NDArray[np.int64], aligned: Array) -> Array:
    """Poses moved as their two keyframes were, in proportion to their place between them."""
    if len(keyframes) < 2:
        return T_map_lidar
    index = np.arange(len(T_map_lidar))
    before = np.minimum(np.searchsorted(keyframes, index, side="right") - 1, len(keyframes) - 2)
    share = (index - keyframes[before]) / (keyframes[before + 1] - keyframes[before])
    ends = [
        se2.parameters_of(aligned[k] @ se2.invert(T_map_lidar[keyframes[k]]) @ T_map_lidar)
        for k in (before, before + 1)
    ]
    turn = se2.wrap_angle(ends[1][:, 2] - ends[0][:, 2])
    x, y = (ends[0][:, :2] + share[:, None] * (ends[1] - ends[0])[:, :2]).T
    return se2.make_motion(x, y, ends[0][:, 2] + share * turn)
