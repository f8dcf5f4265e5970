"""A 2D lidar on a moving robot: whole scans from poses, computed when they are asked for."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.buildings.plan import Material
from sim.robot_run import LidarSpec, RobotRun, Trajectory
from sim.sensors.lidar_noise import NoiseConfig
from sim.sensors.ray_casting import Discs
from sim.sensors.scan_kernel import Scanner, Surroundings, cast_scans, effect_keys, effects_of
from sim.sensors.segment_grid import SegmentGrid, build_segment_grid

_ROUNDING_RAD, _ROUNDING = 1e-6, 1e-6
_SMALLEST_STEP_RAD = 1e-5
_LIMITS = MappingProxyType({"num_beams": (1, 65_536), "range_max_m": (0.0, 1000.0), "scan_period_s": (0.001, 3600.0)})
"""What a lidar can be like."""

ObstaclesAt = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]]
"""``at(stamps_s (S,))`` gives the (S, K, 2) centres of the moving obstacles in frame ``world`` at these times."""


@dataclass(frozen=True)
class Scene:
    """What a lidar can see."""

    grid: SegmentGrid
    """The walls."""
    glass: npt.NDArray[np.bool_]
    """(N,) which of them are of glass."""
    behind_glass: SegmentGrid
    """The others."""
    obstacle_radii_m: npt.NDArray[np.float64]
    """(K,) radii of the moving obstacles (people, other robots)."""
    obstacles_at: ObstaclesAt | None = None
    """Where they are; none: there are none."""


def make_scene(
    segments_m: npt.NDArray[np.float64],
    materials: npt.NDArray[np.int8],
    obstacle_radii_m: npt.NDArray[np.float64] | None = None,
    obstacles_at: ObstaclesAt | None = None,
) -> Scene:
    """Sort a world's surfaces for ray casting.

    Args:
        segments_m: (N, 2, 2) surfaces, metres, frame ``world``.
        materials: (N,) `sim.buildings.plan.Material` of each.
        obstacle_radii_m: (K,) radii of the moving obstacles, if any.
        obstacles_at: Where they are.

    Raises:
        ValueError: obstacles have radii but no places, or places but no radii.
    """
    if (obstacle_radii_m is None) != (obstacles_at is None):
        raise ValueError("moving obstacles need both radii and places")
    radii = np.zeros(0) if obstacle_radii_m is None else np.asarray(obstacle_radii_m, dtype=np.float64)
    glass = np.asarray(materials) == Material.GLASS
    grids = build_segment_grid(segments_m), build_segment_grid(segments_m[~glass])
    return Scene(grids[0], glass, grids[1], radii, obstacles_at)


def scan_run(scene: Scene, trajectory: Trajectory, lidar: LidarSpec, noise: NoiseConfig, *, seed: int) -> RobotRun:
    """The run of a robot whose scans are cast when they are read: the same values however reading is cut.

    Args:
        scene: What the lidar sees; the robot itself is not among its obstacles.
        trajectory: Where the robot was; its name chooses its streams of noise.
        lidar: The lidar.
        noise: What goes wrong with it.
        seed: Seed of the noise alone.

    Raises:
        ValueError: the lidar is impossible.
    """
    check_lidar(lidar)
    directions = np.stack([np.cos(lidar.angles_rad), np.sin(lidar.angles_rad)], axis=-1)
    lidar = lidar if noise.skew else replace(lidar, time_increment_s=0.0)
    scanner = Scanner(directions, lidar.range_min_m, lidar.range_max_m, lidar.time_increment_s)
    poses = se2.parameters_of(trajectory.T_world_robot @ lidar.pose_on_robot)
    rates = _rates(poses, trajectory.stamps_s)
    effects, keys = effects_of(noise), effect_keys(seed, trajectory.robot)

    def read_ranges(start: int, stop: int) -> npt.NDArray[np.float32]:
        discs = _discs_at(scene, trajectory.stamps_s[start:stop])
        motion = (poses[start:stop], rates[start:stop], start)
        return cast_scans(
            Surroundings(scene.grid, scene.glass, scene.behind_glass, discs), scanner, motion, effects, keys
        )

    return RobotRun(trajectory, lidar, read_ranges)


def _discs_at(scene: Scene, stamps_s: npt.NDArray[np.float64]) -> Discs:
    if scene.obstacles_at is None or len(stamps_s) == 0:
        return Discs(np.zeros((1, 0, 2)), np.zeros(0))
    return Discs(np.ascontiguousarray(scene.obstacles_at(stamps_s), dtype=np.float64), scene.obstacle_radii_m)


def _rates(poses: npt.NDArray[np.float64], stamps_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(N, 3) rates of the poses towards the next stamp, the last one as before it; 0 where time stands still."""
    if len(poses) < 2:
        return np.zeros_like(poses)
    change = np.diff(poses, axis=0)
    change[:, 2] = se2.wrap_angle(change[:, 2])
    period_s = np.diff(stamps_s)[:, None]
    rates = np.where(period_s > 0.0, change / np.where(period_s > 0.0, period_s, 1.0), 0.0)
    return np.concatenate([rates, rates[-1:]])


def check_lidar(lidar: LidarSpec) -> None:
    """Refuse a lidar that cannot be.

    Raises:
        ValueError: a value is out of its range.
    """
    if lidar.num_beams < 1:
        raise ValueError(f"lidar: num_beams must be >= 1, got {lidar.num_beams}")
    angles_rad = np.array([lidar.angle_min_rad, lidar.angle_increment_rad])
    if not np.isfinite(angles_rad).all() or abs(lidar.angle_increment_rad) < _SMALLEST_STEP_RAD:
        raise ValueError(
            f"lidar: need finite angles and steps of at least {_SMALLEST_STEP_RAD:g} rad, got {angles_rad.tolist()}"
        )
    turn_rad = abs(lidar.angle_increment_rad) * (lidar.num_beams - 1)
    if turn_rad > 2.0 * np.pi + _ROUNDING_RAD:
        raise ValueError(
            f"lidar: num_beams times angle_increment_rad must be within one turn, got {lidar.num_beams} beams "
            f"{lidar.angle_increment_rad:g} rad apart"
        )
    for name, (low, high) in _LIMITS.items():
        if not low <= getattr(lidar, name) <= high:
            raise ValueError(f"lidar: {name} must be in [{low:g}, {high:g}], got {getattr(lidar, name):g}")
    if len(lidar.T_robot_lidar) != 3 or not np.isfinite(lidar.T_robot_lidar).all():
        raise ValueError(f"lidar: T_robot_lidar must be three finite numbers, got {lidar.T_robot_lidar}")
    if not 0.0 <= lidar.range_min_m < lidar.range_max_m:
        raise ValueError(
            f"lidar: need 0 <= range_min_m < range_max_m, got {lidar.range_min_m:g} and {lidar.range_max_m:g}"
        )
    longest_s = lidar.scan_period_s / max(lidar.num_beams - 1, 1)
    if not 0.0 <= lidar.time_increment_s <= longest_s * (1.0 + _ROUNDING):
        raise ValueError(
            f"lidar: time_increment_s must be in [0, {longest_s:g}], so that a scan of {lidar.num_beams} beams fits "
            f"into scan_period_s = {lidar.scan_period_s:g}, got {lidar.time_increment_s:g}"
        )
