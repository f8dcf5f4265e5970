import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merger import se2
from sim.maps.mapping import OccupancyConfig, OccupancyMapper
from sim.maps.submap_mapping import MappingConfig, PoseSource, map_ground_truth, map_submap
from sim.robot_run import LidarSpec, RobotRun, Trajectory

LIDAR = LidarSpec(60, -2.0, 0.07, 0.1, 30.0, T_robot_lidar=(0.2, -0.1, 0.3))
CONFIG = OccupancyConfig(resolution_m=0.1, max_range_m=4.0, log_odds_limit=3.0)


def cells_crossed(start, end):
    """Slow and obvious: every cell whose open square the segment meets for more than a point."""
    low, high = np.floor(np.minimum(start, end)).astype(int), np.floor(np.maximum(start, end)).astype(int)
    found = set()
    for column in range(low[0], high[0] + 1):
        for row in range(low[1], high[1] + 1):
            enter, leave = 0.0, 1.0
            for axis, cell in enumerate((column, row)):
                way = end[axis] - start[axis]
                if way == 0.0:
                    inside = cell <= start[axis] < cell + 1
                    enter, leave = (enter, leave) if inside else (1.0, 0.0)
                else:
                    t = sorted(((cell - start[axis]) / way, (cell + 1 - start[axis]) / way))
                    enter, leave = max(enter, t[0]), min(leave, t[1])
            if leave - enter > 1e-9:
                found.add((column, row))
    return found


def slow_map(ranges, T_map_robot, lidar, config, motions):
    """Slow and obvious: a dictionary of cells; each scan first collects its hits and its misses."""
    log_odds = {}
    for scan, T_first, motion in zip(ranges, T_map_robot @ lidar.pose_on_robot, motions, strict=True):
        hits, misses = set(), set()
        for b, (r, angle) in enumerate(zip(scan.astype(float), lidar.angles_rad, strict=True)):
            length = config.no_return_free_m if r == math.inf else min(r, config.max_range_m)
            if not length > 0.0:
                continue
            T = T_first @ se2.make_motion(*(b * motion))
            end = se2.transform_points(T, length * np.array([[math.cos(angle), math.sin(angle)]]))[0]
            start, end = T[:2, 2] / config.resolution_m, end / config.resolution_m
            misses |= cells_crossed(start, end)
            if r <= config.max_range_m:
                hits.add(tuple(np.floor(end).astype(int)))
        for cells, change in ((hits, config.log_odds_hit), (misses - hits, config.log_odds_miss)):
            for cell in cells:
                value = log_odds.get(cell, 0.0) + change
                log_odds[cell] = min(max(value, -config.log_odds_limit), config.log_odds_limit)
    return log_odds


def random_scans(rng, count):
    poses = se2.make_motion(*rng.uniform(-2.0, 2.0, (2, count)), rng.uniform(-3.0, 3.0, count))
    ranges = rng.uniform(0.2, 6.0, (count, LIDAR.num_beams)).astype(np.float32)
    ranges[rng.random(ranges.shape) < 0.1] = np.inf
    ranges[rng.random(ranges.shape) < 0.05] = -np.inf
    ranges[rng.random(ranges.shape) < 0.05] = np.nan
    return ranges, poses


def mapped(ranges, poses, config, lidar=LIDAR, motions=None):
    mapper = OccupancyMapper(lidar, config)
    mapper.add_scans(ranges, poses, motions)
    return mapper.grid("map_00")


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 2.5]), st.sampled_from([0.0, 0.01]))
def test_the_kernel_agrees_with_the_slow_oracle(seed, no_return_free_m, moving):
    rng = np.random.default_rng(seed)
    ranges, poses = random_scans(rng, 4)
    motions = rng.normal(0.0, moving, (4, 3))
    config = OccupancyConfig(resolution_m=0.1, max_range_m=4.0, no_return_free_m=no_return_free_m, log_odds_limit=3.0)
    grid = mapped(ranges, poses, config, motions=motions)
    expected = slow_map(ranges, poses, LIDAR, config, motions)
    column, row = np.round(grid.T_map_grid[:2, 2] / 0.1).astype(int)
    found = {(c + column, r + row): grid.log_odds[r, c] for r, c in zip(*np.nonzero(grid.log_odds), strict=True)}
    expected = {cell: value for cell, value in expected.items() if abs(value) > 1e-6}
    wrong = {k for k in found.keys() | expected.keys() if abs(found.get(k, 0.0) - expected.get(k, 0.0)) > 1e-4}
    assert len(wrong) <= 0.001 * len(expected)  # a beam through a corner: either cell is right


def test_a_cell_that_ends_a_beam_is_not_freed_by_another_beam_of_the_same_scan():
    lidar = LidarSpec(2, 0.0, 0.001, 0.1, 30.0)
    grid = mapped(np.array([[1.02, 3.02]], dtype=np.float32), np.eye(3)[None], CONFIG, lidar)
    row, column = np.floor(grid.cells_from_points_map(np.array([[1.02, 0.0]]))[0]).astype(int)
    assert grid.log_odds[row, column] == pytest.approx(CONFIG.log_odds_hit)


def test_a_cell_that_many_beams_of_a_scan_cross_is_updated_once():
    lidar = LidarSpec(50, 0.0, 0.0005, 0.1, 30.0)
    grid = mapped(np.full((1, 50), 3.02, dtype=np.float32), np.eye(3)[None], CONFIG, lidar)
    assert grid.log_odds.min() == pytest.approx(CONFIG.log_odds_miss)
    assert grid.log_odds.max() == pytest.approx(CONFIG.log_odds_hit)


def test_a_beam_beyond_the_usable_range_frees_up_to_it_and_hits_nothing():
    grid = mapped(np.array([[9.0]], dtype=np.float32), np.eye(3)[None], CONFIG, LidarSpec(1, 0.0, 0.1, 0.1, 30.0))
    assert not grid.occupied.any()
    assert grid.size_m[0] == pytest.approx(CONFIG.max_range_m, abs=0.11)


def test_beams_without_return_too_near_or_invalid_leave_the_map_unknown():
    ranges = np.array([[np.inf, -np.inf, np.nan]], dtype=np.float32)
    grid = mapped(ranges, np.eye(3)[None], CONFIG, LidarSpec(3, 0.0, 0.1, 0.1, 30.0))
    assert not grid.log_odds.any()


def test_a_map_does_not_depend_on_how_its_scans_come_in():
    ranges, poses = random_scans(np.random.default_rng(0), 40)
    poses[:, 0, 2] += np.linspace(0.0, 60.0, 40)
    whole, mapper = mapped(ranges, poses, CONFIG), OccupancyMapper(LIDAR, CONFIG)
    for a, b in ((0, 1), (1, 7), (7, 7), (7, 40)):
        mapper.add_scans(ranges[a:b], poses[a:b])
    parts = mapper.grid("map_00")
    assert np.array_equal(parts.log_odds, whole.log_odds)
    assert np.array_equal(parts.T_map_grid, whole.T_map_grid)


@pytest.mark.parametrize("far_m", [1e4, 1e30])
def test_poses_too_far_apart_for_one_map_are_refused(far_m):
    ranges, poses = random_scans(np.random.default_rng(0), 2)
    poses[1, :2, 2] = far_m
    mapper = OccupancyMapper(LIDAR, CONFIG)
    mapper.add_scans(ranges[:1], poses[:1])
    with pytest.raises(ValueError, match=r"a map of .* m in cells of 0\.1 m is too large"):
        mapper.add_scans(ranges[1:], poses[1:])


def test_shifting_the_robot_by_whole_cells_shifts_the_map_by_as_much():
    ranges, poses = random_scans(np.random.default_rng(1), 10)
    shifted = poses.copy()
    shifted[:, :2, 2] += [12.8, -6.4]
    before, after = mapped(ranges, poses, CONFIG), mapped(ranges, shifted, CONFIG)
    assert np.mean(before.log_odds != after.log_odds) < 1e-3
    np.testing.assert_allclose(after.T_map_grid[:2, 2] - before.T_map_grid[:2, 2], [12.8, -6.4], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("resolution_m", 0.0),
        ("max_range_m", -1.0),
        ("no_return_free_m", 21.0),
        ("log_odds_hit", 0.0),
        ("log_odds_miss", 0.1),
        ("log_odds_limit", 0.5),
        ("resolution_m", math.nan),
    ],
)
def test_impossible_settings_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"{name} must be .*got"):
        OccupancyConfig(**{name: value})


def box_run(num_scans=30):
    """A robot that drives through a square room of 6 m; its odometry turns too far."""
    x = np.linspace(-1.5, 1.5, num_scans)
    T = se2.make_motion(x, 0.1 * x, 0.2 * x)
    T_odom = se2.invert(T[0]) @ T @ se2.make_motion(np.zeros(num_scans), 0.0, 0.01 * np.arange(num_scans))
    lidar = LidarSpec(180, -math.pi, math.radians(2.0), 0.1, 30.0)
    angles = se2.angle_of(T)[:, None] + lidar.angles_rad
    way = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    walls = (3.0 * np.sign(way) - T[:, None, :2, 2]) / way
    ranges = walls.min(axis=-1).astype(np.float32)
    trajectory = Trajectory("robot_0", 0.1 * np.arange(num_scans), T, T_odom)
    return RobotRun(trajectory, lidar, lambda start, stop: ranges[start:stop])


@pytest.mark.parametrize("source", list(PoseSource))
def test_a_submap_begins_where_the_caller_says_whatever_its_poses_come_from(source):
    T_first = se2.make_motion(3.0, -2.0, 1.0)
    result = map_submap(box_run(), 5, 25, MappingConfig(poses=source), name="map_03", T_map_first=T_first)
    np.testing.assert_allclose(result.T_map_robot[0], T_first, atol=1e-12)
    assert result.T_map_robot.shape == (20, 3, 3)
    assert result.grid.name == "map_03"


def test_truth_gives_the_true_motions_and_odometry_the_told_ones():
    run = box_run()
    for source, poses in (
        (PoseSource.TRUTH, run.trajectory.T_world_robot),
        (PoseSource.ODOMETRY, run.trajectory.T_odom_robot),
    ):
        result = map_submap(run, 5, 25, MappingConfig(poses=source), name="m", T_map_first=poses[5])
        np.testing.assert_allclose(result.T_map_robot, poses[5:25], atol=1e-9)


def test_the_true_map_has_its_walls_where_the_world_has_them():
    grid = map_ground_truth([box_run()], OccupancyConfig(resolution_m=0.05))
    walls = grid.cell_centers(grid.occupied)
    assert np.abs(np.abs(walls).max(axis=1) - 3.0).max() < 0.05
    free = grid.cell_centers(grid.free)
    assert np.abs(free).max() < 3.0
    assert len(free) * 0.05**2 == pytest.approx(36.0, rel=0.05)


@pytest.mark.parametrize(("start", "stop"), [(5, 5), (-1, 4), (20, 31)])
def test_a_part_that_the_run_does_not_have_is_refused(start, stop):
    with pytest.raises(ValueError, match="are not a part of a run of 30 scans"):
        map_submap(box_run(), start, stop, MappingConfig(), name="m", T_map_first=np.eye(3))
