import gzip
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from sim.maps.joint_alignment import JointAlignmentConfig
from sim.maps.likelihood_field import BLOCK, draw_surfaces, search_pose
from sim.maps.pose_refinement import refine_pose
from sim.maps.scan_matching import ScanMatchingConfig
from sim.maps.scan_surfaces import find_surfaces, fit_normals
from sim.maps.submap_poses import PoseEstimationConfig, estimate_poses, expect_odometry
from sim.robot_run import LidarSpec, RobotRun, Trajectory
from sim.sensors.lidar import make_scene, scan_run
from sim.sensors.lidar_noise import NOISE_PRESETS, NoiseConfig
from sim.sensors.odometry import OdometryConfig, integrate_odometry

LOGS = Path(__file__).resolve().parents[4] / "shared" / "data"
LIDAR = LidarSpec(180, -math.pi / 2, math.radians(1.0), 0.05, 30.0, T_robot_lidar=(0.1, 0.0, 0.0))
DRIFTING = OdometryConfig(step_m=0.1)


def rooms():
    """Two rooms with a door between them and things in them."""

    def box(x0, y0, x1, y1):
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        return [[corners[k], corners[(k + 1) % 4]] for k in range(4)]

    walls = [*box(0, 0, 14, 8), [(7, 0), (7, 3.2)], [(7, 4.6), (7, 8)]]
    for x, y, size in [
        (2, 6.5, 0.8),
        (1, 1, 0.5),
        (5, 6.9, 0.6),
        (9, 1.2, 1.0),
        (12, 6, 0.7),
        (10.5, 7, 0.4),
        (4, 1, 0.3),
    ]:
        walls += box(x, y, x + size, y + 0.6 * size)
    return np.array(walls, dtype=float)


def rounds_through_rooms(step_m):
    """Twice around through both rooms and their door."""
    knots = np.array([[2, 3.9], [6, 3.9], [9, 3.9], [12, 2.5], [12.5, 4.5], [9, 4.2], [6, 3.9], [3, 5.5], [2, 3.9]])
    knots = np.concatenate([knots, knots[1:]])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(knots, axis=0).T))])
    at = np.arange(0.0, length[-1], step_m)
    x, y = np.interp(at, length, knots[:, 0]), np.interp(at, length, knots[:, 1])
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    return se2.make_motion(x, y, np.convolve(np.pad(heading, 2, mode="edge"), np.full(5, 0.2), "valid"))


def simulated_run(step_m=0.3, noise=NOISE_PRESETS["realistic"], odometry=DRIFTING, seed=0):
    T, walls = rounds_through_rooms(step_m), rooms()
    T_odom = integrate_odometry(T, odometry, np.random.default_rng(seed))
    trajectory = Trajectory("robot_0", 0.2 * np.arange(len(T)), T, T_odom)
    return scan_run(make_scene(walls, np.zeros(len(walls), dtype=np.int8)), trajectory, LIDAR, noise, seed=seed)


def distortion_m(T_estimate, T_true):
    """Root mean square distance of the positions after the best rigid fit."""
    a, b = T_true[:, :2, 2], T_estimate[:, :2, 2]
    U, _, Vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    R = Vt.T @ np.diag([1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T
    return float(np.sqrt((((a - a.mean(axis=0)) - (b - b.mean(axis=0)) @ R.T) ** 2).sum(axis=1).mean()))


def estimated(run, **changes):
    config = PoseEstimationConfig(odometry=DRIFTING, **changes)
    return estimate_poses(run, 0, run.num_scans, config, 20.0)


def test_the_search_finds_what_looking_everywhere_finds():
    """Branch and bound against all poses of the lattice."""
    rng = np.random.default_rng(0)
    field, coarse = np.zeros((40 * BLOCK, 40 * BLOCK), np.float32), np.zeros((40, 40), np.float32)
    surfaces = rng.uniform(40.0, 120.0, (30, 2))
    draw_surfaces(field, coarse, surfaces, rng.random(30) < 0.4 * (np.arange(30) < 29), 1.6)
    points = surfaces - [80.0, 80.0] + [3.0, -5.0] + rng.normal(0.0, 0.5, surfaces.shape)
    window, prior = (80.0, 80.0, 8.0, 0.1, 0.02), (0.5, 0.01, 10.0)
    best = -np.inf
    for turn in 0.02 * np.arange(-5, 6):
        cosine, sine = math.cos(turn), math.sin(turn)
        turned = points @ np.array([[cosine, sine], [-sine, cosine]]) + 80.0
        for x in range(-2 * BLOCK, 3 * BLOCK):
            for y in range(-2 * BLOCK, 3 * BLOCK):
                column, row = np.floor(turned + np.array([x, y])).astype(int).T
                score = 0.5 * field[row, column].astype(float).sum() - 0.005 * (x * x + y * y) - 5.0 * turn * turn
                best = max(best, score)
    found = search_pose(field, coarse, points, window, prior)
    assert found[3] == pytest.approx(best, abs=1e-9)
    assert found[:2] == (-3.0, 5.0)


@pytest.mark.parametrize("turn_deg", [-3.0, -1.0, 2.0])
def test_walls_at_arms_length_outweigh_odometry_that_is_off_by_two_sigma(turn_deg):
    """The slip of a robot that turns in a nook: a degree moves its short beams by a centimetre or less."""
    angles = np.radians(np.arange(-90.0, 90.0))
    ranges = np.minimum(9.0 / np.abs(np.cos(angles)), 12.0 / np.maximum(np.abs(np.sin(angles)), 1e-9))
    ends = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    field, coarse = np.zeros((16 * BLOCK, 16 * BLOCK), np.float32), np.zeros((16, 16), np.float32)
    linked = np.arange(len(ends)) < len(ends) - 1
    draw_surfaces(field, coarse, ends + 32.3, linked, 1.0)
    turn = math.radians(turn_deg)
    turned = ends @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    prior = (2.0, 1.0 / 0.4**2, 1.0 / math.radians(1.5) ** 2)
    found = refine_pose(field, turned, (32.3, 32.3, 0.0, 0.0, 0.0), prior, 1.0)
    assert math.degrees(found[2]) == pytest.approx(-turn_deg, abs=0.5)


def test_the_field_is_the_nearness_of_the_nearest_surface():
    rng = np.random.default_rng(1)
    field, coarse = np.zeros((16 * BLOCK, 16 * BLOCK), np.float32), np.zeros((16, 16), np.float32)
    points = rng.uniform(15.0, 50.0, (12, 2))
    linked = np.array([True, False, True, True, False, False, True, False, False, True, True, False])
    draw_surfaces(field, coarse, points, linked, 2.0)
    centers = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5), axis=-1)
    distance = np.full(field.shape, np.inf)
    for i in range(12):
        a, b = points[i], points[i + 1] if linked[i] else points[i]
        along = np.clip(((centers - a) @ (b - a)) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0)
        distance = np.minimum(distance, np.linalg.norm(centers - a - along[..., None] * (b - a), axis=-1))
    expected = np.where(distance < 6.0, np.exp(-0.5 * (distance / 2.0) ** 2), 0.0)
    np.testing.assert_allclose(field, expected, atol=1e-6)
    blocks = field.reshape(16, BLOCK, 16, BLOCK).max(axis=(1, 3))
    assert (coarse >= blocks).all()
    assert (coarse[:-1, :-1] >= np.maximum(blocks[1:, 1:], blocks[:-1, 1:])).all()


def test_normals_of_a_scan_stand_on_its_walls_and_point_to_the_lidar():
    lidar = LidarSpec(181, -math.pi / 2, math.radians(1.0), 0.05, 30.0)
    angles = lidar.angles_rad
    with np.errstate(divide="ignore"):
        ranges = np.minimum(3.0 / np.cos(angles), 2.0 / np.abs(np.sin(angles))).astype(np.float32)
    ranges[40] = np.inf
    ends, linked = find_surfaces(ranges[None], lidar, 20.0, np.zeros((1, 3)))
    surfaces = fit_normals(ends, linked, lidar)
    assert np.isnan(ends[..., 2:]).all()
    assert np.isnan(surfaces[0, 40]).all()
    assert not linked[0, 39:41].any()
    np.testing.assert_allclose(surfaces[0, 85:95, 2:], np.tile([-1.0, 0.0], (10, 1)), atol=1e-5)
    np.testing.assert_allclose(surfaces[0, 5:20, 2:], np.tile([0.0, 1.0], (15, 1)), atol=1e-5)


@pytest.mark.parametrize("step_deg", [1.0, 0.25])
def test_normals_stand_noise_whether_beams_are_few_or_many(step_deg):
    """Many beams lie close together: a normal by a fixed number of them is one of noise."""
    lidar = LidarSpec(round(60.0 / step_deg), math.radians(-30.0), math.radians(step_deg), 0.05, 30.0)
    noise = np.random.default_rng(2).normal(0.0, 0.02, (20, lidar.num_beams))
    ranges = (3.0 / np.cos(lidar.angles_rad) + noise).astype(np.float32)
    surfaces = fit_normals(*find_surfaces(ranges, lidar, 20.0, np.zeros((20, 3))), lidar)
    off = np.arctan2(np.abs(surfaces[..., 3]), -surfaces[..., 2])
    assert np.degrees(np.nanmedian(off)) < 3.0


@pytest.mark.parametrize("seed", range(3))
def test_matching_takes_away_the_drift_of_odometry(seed):
    run = simulated_run(seed=seed)
    T = run.trajectory.T_world_robot
    assert distortion_m(run.trajectory.T_odom_robot, T) > 0.15
    assert distortion_m(estimated(run), T) < 0.03


def test_joint_alignment_is_better_than_matching_alone():
    run = simulated_run(step_m=0.6, seed=4)
    T = run.trajectory.T_world_robot
    assert distortion_m(estimated(run), T) < distortion_m(estimated(run, joint=False), T)


def test_exact_odometry_and_exact_ranges_stay_exact():
    still = OdometryConfig(alpha1=0.0, alpha2=0.0, alpha3=0.0, alpha4=0.0)
    run = simulated_run(noise=NoiseConfig(), odometry=still)
    assert distortion_m(estimated(run), run.trajectory.T_world_robot) < 0.01


def test_wheels_that_err_more_are_expected_to_and_never_less():
    config = expect_odometry(PoseEstimationConfig(), OdometryConfig(alpha1=0.9, alpha2=0.0, step_m=0.3))
    assert config.odometry == OdometryConfig(alpha1=0.9, step_m=0.3)


def test_the_estimate_does_not_depend_on_the_frame_of_the_odometry():
    run = simulated_run(step_m=0.5)
    path = run.trajectory
    moved = Trajectory(
        "robot_0", path.stamps_s, path.T_world_robot, se2.make_motion(5.0, -7.0, 2.0) @ path.T_odom_robot
    )
    other = RobotRun(moved, run.lidar, run.read_ranges)
    np.testing.assert_allclose(estimated(other), estimated(run), atol=1e-6)


def test_the_same_run_gives_the_same_poses_to_the_last_bit():
    assert estimated(simulated_run(step_m=0.5)).tobytes() == estimated(simulated_run(step_m=0.5)).tobytes()


def test_scans_without_a_single_return_leave_the_poses_to_odometry():
    run = simulated_run(step_m=0.5)
    nothing = np.full((run.num_scans, LIDAR.num_beams), np.inf, dtype=np.float32)
    blind = RobotRun(run.trajectory, run.lidar, lambda start, stop: nothing[start:stop])
    np.testing.assert_allclose(estimated(blind), run.trajectory.T_odom_robot, atol=1e-9)


@pytest.mark.parametrize("config", [ScanMatchingConfig, JointAlignmentConfig])
def test_impossible_settings_are_refused_by_name(config):
    for name in config.__dataclass_fields__:
        with pytest.raises(ValueError, match=f"{name} must be > 0, got -1"):
            config(**{name: -1})


def read_log(path):
    """(N, B) ranges and (N, 3, 3) corrected poses of a CARMEN log's FLASER lines."""
    ranges, poses = [], []
    with gzip.open(path, "rt") as lines:
        for words in (line.split() for line in lines if line.startswith("FLASER")):
            count = int(words[1])
            ranges.append([float(v) for v in words[2 : 2 + count]])
            poses.append([float(v) for v in words[2 + count : 5 + count]])
    ranges = np.array(ranges, dtype=np.float32)
    ranges[ranges >= 50.0] = np.inf
    return ranges, se2.make_motion(*np.array(poses).T)


@pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs are not here")
def test_every_eighth_of_the_intel_log_bends_by_less_than_a_decimetre():
    ranges, T = read_log(LOGS / "intel-corrected.log.gz")
    T_odom = integrate_odometry(T, OdometryConfig(), np.random.default_rng(0))
    trajectory = Trajectory("robot_0", np.arange(float(len(T))), T, T_odom)
    lidar = LidarSpec(180, -math.pi / 2, math.radians(1.0), 0.0, 50.0)
    run = RobotRun(trajectory, lidar, lambda start, stop: ranges[start:stop])
    cuts = np.linspace(0, len(T), 9).astype(int)
    for start, stop in itertools.pairwise(cuts):
        estimate = estimate_poses(run, start, stop, PoseEstimationConfig(), 20.0)
        assert distortion_m(estimate, T[start:stop]) < 0.10
        assert distortion_m(T_odom[start:stop], T[start:stop]) > 0.3
