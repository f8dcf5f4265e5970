"""Rays a second on one core, in a floor of rooms with 500 wall segments: ours beside pymunk's and numpy's."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from sim.buildings.plan import Material
from sim.robot_run import LidarSpec, Trajectory
from sim.sensors.lidar import make_scene, scan_run
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.sensors.ray_casting import cast_rays
from sim.sensors.segment_grid import build_segment_grid

_spec = importlib.util.spec_from_file_location(
    "pymunk_rays", Path(__file__).parents[1] / "sim" / "sensors" / "pymunk_rays.py"
)
pymunk_rays = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(pymunk_rays)

LIDAR = LidarSpec(360, -math.pi, math.radians(1.0), 0.1, 30.0, 0.1, 0.0002)
ROOM_M, ROOMS, DOOR_M = 4.0, 11, 1.0


def floor_of_rooms():
    """Rooms in a square, each wall between two with a door in it: 506 segments."""
    walls = []
    for i in range(ROOMS + 1):
        for j in range(ROOMS):
            for turned in (False, True):
                start, end = np.array([j, i]) * ROOM_M, np.array([j + 1, i]) * ROOM_M
                door = (start + end) / 2.0 + np.array([[-0.5], [0.5]]) * DOOR_M * np.array([1.0, 0.0])
                pieces = [(start, end)] if i in (0, ROOMS) else [(start, door[0]), (door[1], end)]
                walls += [(a[::-1], b[::-1]) if turned else (a, b) for a, b in pieces]
    return np.array(walls)


def drive(num_scans):
    """Poses all over the floor, never in a wall."""
    rng = np.random.default_rng(0)
    rooms = rng.integers(0, ROOMS, (num_scans, 2)) * ROOM_M
    x, y = (rooms + rng.uniform(0.3, ROOM_M - 0.3, (num_scans, 2))).T
    T = se2.make_motion(x, y, rng.uniform(-3.0, 3.0, num_scans))
    return Trajectory("robot_0", 0.1 * np.arange(num_scans), T, T)


def rays_of(num_scans):
    path = drive(num_scans)
    angles = se2.angle_of(path.T_world_robot)[:, None] + LIDAR.angles_rad
    return np.repeat(path.T_world_robot[:, :2, 2], LIDAR.num_beams, axis=0), angles.ravel()


def numpy_rays(walls, origins, angles):
    """Every ray against every wall, as arrays."""
    way = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
    edge, to_start = walls[None, :, 1] - walls[None, :, 0], walls[None, :, 0] - origins[:, None]
    across = way[..., 0] * edge[..., 1] - way[..., 1] * edge[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_start[..., 0] * edge[..., 1] - to_start[..., 1] * edge[..., 0]) / across
        s = (to_start[..., 0] * way[..., 1] - to_start[..., 1] * way[..., 0]) / across
    return np.where((t > 0.0) & (s >= 0.0) & (s <= 1.0), t, np.inf).min(axis=1)


def note_rate(benchmark, count, what="rays_per_s"):
    if benchmark.stats is not None:
        benchmark.extra_info[what] = count / benchmark.stats.stats.min


@pytest.mark.benchmark(group="rays")
def test_rays_by_pymunk(benchmark):
    space = pymunk_rays.make_space(floor_of_rooms())
    origins, angles = rays_of(10)
    benchmark(lambda: [pymunk_rays.cast(space, o, a, LIDAR.range_max_m) for o, a in zip(origins, angles, strict=True)])
    note_rate(benchmark, len(angles))


@pytest.mark.benchmark(group="rays")
def test_rays_by_numpy(benchmark):
    origins, angles = rays_of(10)
    benchmark(numpy_rays, floor_of_rooms(), origins, angles)
    note_rate(benchmark, len(angles))


@pytest.mark.benchmark(group="rays")
def test_rays_one_by_one(benchmark):
    grid = build_segment_grid(floor_of_rooms())
    origins, angles = rays_of(1000)
    benchmark(cast_rays, grid, origins, angles, LIDAR.range_max_m)
    note_rate(benchmark, len(angles))


@pytest.mark.benchmark(group="rays")
@pytest.mark.parametrize("noise", ["none", "realistic", "high"])
def test_rays_as_scans(benchmark, noise):
    walls = floor_of_rooms()
    materials = np.where(np.arange(len(walls)) % 10 == 0, Material.GLASS, Material.WALL).astype(np.int8)
    people = np.random.default_rng(1).uniform(0.0, 44.0, (1, 6, 2))
    scene = make_scene(walls, materials, np.full(6, 0.2), lambda stamps_s: np.repeat(people, len(stamps_s), axis=0))
    run = scan_run(scene, drive(1000), LIDAR, NOISE_PRESETS[noise], seed=0)
    ranges = benchmark(run.read_ranges, 0, run.num_scans)
    note_rate(benchmark, ranges.size)
