"""Scans a second on one core: mapped at known poses, and matched."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from sim.maps.mapping import OccupancyConfig, OccupancyMapper
from sim.maps.submap_poses import PoseEstimationConfig, estimate_poses
from sim.robot_run import Trajectory
from sim.sensors.lidar import make_scene, scan_run
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.sensors.odometry import OdometryConfig, integrate_odometry

_here = Path(__file__)
_spec = importlib.util.spec_from_file_location("ray_casting_speed", _here.with_name("test_ray_casting_speed.py"))
rays = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(rays)


def a_run(num_scans):
    """A robot that circles in the middle of the floor of rooms, 360 beams a scan."""
    walls = rays.floor_of_rooms()
    phase = np.linspace(0.0, 12.0, num_scans)
    T = rays.se2.make_motion(22.0 + 1.2 * np.cos(phase), 22.0 + 1.2 * np.sin(phase), phase + np.pi / 2.0)
    T_odom = integrate_odometry(T, OdometryConfig(), np.random.default_rng(0))
    scene = make_scene(walls, np.zeros(len(walls), dtype=np.int8))
    return scan_run(
        scene,
        Trajectory("robot_0", 0.1 * np.arange(num_scans), T, T_odom),
        rays.LIDAR,
        NOISE_PRESETS["realistic"],
        seed=0,
    )


@pytest.mark.benchmark(group="scans")
def test_scans_mapped_at_known_poses(benchmark):
    path = rays.drive(2000)
    walls = rays.floor_of_rooms()
    run = scan_run(
        make_scene(walls, np.zeros(len(walls), dtype=np.int8)), path, rays.LIDAR, NOISE_PRESETS["none"], seed=0
    )
    ranges = run.read_ranges(0, run.num_scans)

    def map_all():
        mapper = OccupancyMapper(rays.LIDAR, OccupancyConfig(resolution_m=0.05))
        for k in range(0, run.num_scans, 250):
            mapper.add_scans(ranges[k : k + 250], path.T_world_robot[k : k + 250])
        return mapper.grid("map")

    assert benchmark(map_all).occupied.any()
    rays.note_rate(benchmark, run.num_scans, "scans_per_s")


@pytest.mark.benchmark(group="scans")
def test_scans_matched_and_aligned(benchmark):
    run = a_run(300)
    benchmark(estimate_poses, run, 0, run.num_scans, PoseEstimationConfig(), 20.0)
    rays.note_rate(benchmark, run.num_scans, "scans_per_s")
