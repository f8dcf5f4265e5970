import math
from dataclasses import replace

import numpy as np
import pytest

from merger import se2
from sim.maps.mapping import OccupancyConfig
from sim.maps.scan_skew import motion_per_beam
from sim.maps.scan_surfaces import find_surfaces
from sim.maps.submap_mapping import map_ground_truth
from sim.maps.submap_poses import PoseEstimationConfig, estimate_poses
from sim.robot_run import LidarSpec, Trajectory
from sim.sensors.lidar import make_scene, scan_run
from sim.sensors.lidar_noise import NoiseConfig

SLOW_TURN = LidarSpec(360, -math.pi, math.radians(1.0), 0.05, 20.0, 0.2, 0.2 / 360, (0.1, 0.05, 0.4))
"""A lidar whose mirror takes a whole scan period for a turn."""
CORNERS = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 5.0], [6.0, 5.0], [6.0, 7.0], [0.0, 7.0]])
WALLS = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)


SKEW = NoiseConfig(skew=True)


def quick_run(noise=SKEW):
    """A robot that drives and turns quickly through a room."""
    s = np.arange(0.0, 2.0 * math.pi, 0.05)
    T = se2.make_motion(3.5 + 2.2 * np.cos(s), 3.0 + 1.6 * np.sin(s), s + 1.2 * np.sin(3.0 * s))
    path = Trajectory("robot_0", 0.2 * np.arange(len(s)), T, se2.invert(T[0]) @ T)
    return scan_run(make_scene(WALLS, np.zeros(len(WALLS), dtype=np.int8)), path, SLOW_TURN, noise, seed=0)


def distance_to_walls(points):
    a, along = WALLS[:, 0], WALLS[:, 1] - WALLS[:, 0]
    t = np.clip(((points[:, None] - a) * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    return np.linalg.norm(points[:, None] - a - t[..., None] * along, axis=-1).min(axis=1)


def test_ends_of_a_skewed_scan_lie_on_the_walls_once_the_motion_is_undone():
    run = quick_run()
    T = run.trajectory.T_world_robot @ run.lidar.pose_on_robot
    motions = motion_per_beam(T, run.trajectory.stamps_s, run.lidar)
    for off, undone in ((motions, True), (np.zeros_like(motions), False)):
        surfaces, _ = find_surfaces(run.read_ranges(0, run.num_scans), run.lidar, 20.0, off)
        ends = np.concatenate([se2.transform_points(T[k], surfaces[k, :, :2]) for k in range(run.num_scans - 1)])
        assert (distance_to_walls(ends).max() < 0.002) == undone


def test_the_walls_of_a_map_of_skewed_scans_are_as_thin_as_they_are():
    grid = map_ground_truth([quick_run()], OccupancyConfig(resolution_m=0.05))
    assert distance_to_walls(grid.cell_centers(grid.occupied)).max() < 0.06


def test_poses_by_matching_are_those_of_the_first_beams():
    run = quick_run()
    T = run.trajectory.T_world_robot
    estimate = T[0] @ estimate_poses(run, 0, run.num_scans, PoseEstimationConfig(), 20.0)
    assert np.hypot(*(estimate - T)[:, :2, 2].T).max() < 0.02


def test_a_lidar_that_takes_whole_scans_at_once_says_so():
    assert quick_run().lidar.time_increment_s == SLOW_TURN.time_increment_s
    whole = quick_run(NoiseConfig())
    assert whole.lidar.time_increment_s == 0.0
    assert not motion_per_beam(whole.trajectory.T_world_robot, whole.trajectory.stamps_s, whole.lidar).any()


def test_nothing_moves_where_time_stands_still_and_the_last_scan_goes_on_as_the_one_before():
    T = se2.make_motion(np.array([0.0, 1.0, 3.0, 3.5]), np.zeros(4), np.zeros(4))
    lidar = replace(SLOW_TURN, time_increment_s=0.01)
    motions = motion_per_beam(T, np.array([0.0, 0.5, 0.5, 1.0]), lidar)
    np.testing.assert_allclose(motions[:, 0], [0.02, 0.0, 0.01, 0.01])
    assert motion_per_beam(T[:1], np.zeros(1), lidar) == pytest.approx(np.zeros((1, 3)))
