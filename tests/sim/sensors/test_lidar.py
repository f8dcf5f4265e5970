import dataclasses
import math

import numpy as np
import pytest

from merger import se2
from sim.buildings.plan import Material
from sim.robot_run import LidarSpec, Trajectory
from sim.sensors.lidar import make_scene, scan_run
from sim.sensors.lidar_noise import NOISE_PRESETS, NoiseConfig
from sim.sensors.lidar_presets import LIDAR_PRESETS
from sim.sensors.ray_casting import cast_rays
from sim.sensors.segment_grid import build_segment_grid

NUM_SCANS = 400
LIDAR = LidarSpec(180, -math.pi / 2, math.radians(1.0), 0.1, 12.0, 0.1, 0.0002, T_robot_lidar=(0.2, 0.05, 0.1))
EFFECTS = [field.name for field in dataclasses.fields(NoiseConfig)]


def room(width=8.0, height=6.0, gap=True):
    """A room with a block in it and, on the right, an open side: beams through it do not return."""
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    walls = [[corners[k], corners[(k + 1) % 4]] for k in range(4) if not (gap and k == 1)]
    block = [(3.5, 2.5), (4.5, 2.5), (4.5, 3.5), (3.5, 3.5)]
    return np.array(walls + [[block[k], block[(k + 1) % 4]] for k in range(4)])


def trajectory(num_scans=NUM_SCANS, robot="robot_0", still=False):
    phase = np.zeros(num_scans) if still else np.linspace(0.0, 4.0, num_scans)
    T = se2.make_motion(4.0 + 2.0 * np.cos(phase), 3.0 + 1.7 * np.sin(phase), phase + 1.5)
    return Trajectory(robot, 0.1 * np.arange(num_scans), T, se2.invert(T[0]) @ T)


def scan(noise, *, seed=1, lidar=LIDAR, walls=None, materials=None, path=None, obstacles=None):
    walls = room() if walls is None else walls
    materials = np.zeros(len(walls), dtype=np.int8) if materials is None else materials
    scene = make_scene(walls, materials, *(obstacles or (None, None)))
    path = trajectory() if path is None else path
    return scan_run(scene, path, lidar, noise, seed=seed).read_ranges(0, len(path.stamps_s))


TRUE = NoiseConfig()
SETTINGS = {name: getattr(NOISE_PRESETS["high"], name) for name in EFFECTS}


def test_without_noise_every_range_is_the_true_one_in_millimetres():
    ranges, path = scan(TRUE), trajectory()
    poses = path.T_world_robot @ LIDAR.pose_on_robot
    grid = build_segment_grid(room())
    angles = se2.angle_of(poses)[:, None] + LIDAR.angles_rad
    origins = np.repeat(poses[:, :2, 2], LIDAR.num_beams, axis=0)
    expected = cast_rays(grid, origins, angles.ravel(), LIDAR.range_max_m).ranges_m.reshape(ranges.shape)
    near = np.isfinite(expected)
    assert np.array_equal(np.isposinf(ranges), ~near)
    assert np.abs(ranges[near] - expected[near]).max() <= 0.0005 + 1e-6


def test_the_lidar_sits_where_its_mounting_says():
    walls, still = np.array([[[5.0, -9.0], [5.0, 9.0]]]), np.eye(3)[None]
    path = Trajectory("robot_0", np.zeros(1), still, still)
    lidar = dataclasses.replace(LIDAR, num_beams=1, angle_min_rad=0.0, T_robot_lidar=(1.0, 0.0, 0.0))
    assert scan(TRUE, lidar=lidar, walls=walls, path=path)[0, 0] == pytest.approx(4.0)
    turned = dataclasses.replace(lidar, T_robot_lidar=(1.0, 0.0, math.pi))
    assert np.isposinf(scan(TRUE, lidar=turned, walls=walls, path=path)[0, 0])


def test_angles_keep_the_rule_that_users_of_a_scan_check():
    for lidar in LIDAR_PRESETS.values():
        expected = lidar.angle_min_rad + lidar.angle_increment_rad * (lidar.num_beams - 1)
        assert lidar.angle_max_rad == expected
        assert lidar.angles_rad[-1] == pytest.approx(expected, abs=1e-12)
        assert len(lidar.angles_rad) == lidar.num_beams


def test_too_near_no_return_and_invalid_read_as_rep_117_says():
    walls = np.array([[[0.05, -1.0], [0.05, 1.0]]])
    path = Trajectory("robot_0", np.zeros(1), np.eye(3)[None], np.eye(3)[None])
    lidar = LidarSpec(2, 0.0, math.pi, 0.1, 12.0)
    assert scan(TRUE, lidar=lidar, walls=walls, path=path)[0].tolist() == [-math.inf, math.inf]
    dropped = scan(NoiseConfig(dropout=1.0), lidar=lidar, walls=walls, path=path)[0]
    assert math.isnan(dropped[0])
    assert dropped[1] == math.inf


@pytest.mark.parametrize("noise", [*({name: value} for name, value in SETTINGS.items() if name != "skew"), SETTINGS])
def test_noise_never_touches_a_beam_without_return(noise):
    """The lidar stands still, with no angular noise: every beam without return stays one."""
    noise = NoiseConfig(**{**noise, "angle_sigma_rad": 0.0})
    nothing = np.isposinf(scan(TRUE, path=trajectory(still=True)))
    assert nothing.any()
    assert np.isposinf(scan(noise, path=trajectory(still=True))[nothing]).all()


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_does_something_and_none_is_on_by_default(name):
    walls = room()
    materials = np.full(len(walls), Material.GLASS, dtype=np.int8)
    before = scan(TRUE, materials=materials)
    after = scan(NoiseConfig(**{name: SETTINGS[name]}), materials=materials)
    assert not np.array_equal(before, after, equal_nan=True)
    assert getattr(TRUE, name) in (0.0, False)


@pytest.mark.parametrize("changed", ["dropout", "max_range_miss", "mixed_pixel", "incidence_loss"])
def test_changing_one_effect_never_reshuffles_another(changed):
    """With all effects on, switching one off changes a beam only where that effect alone had touched it."""
    full = NoiseConfig(**{**SETTINGS, "range_sigma_m": 0.0, "range_sigma_ratio": 0.0})
    alone = NoiseConfig(**{changed: SETTINGS[changed], "angle_sigma_rad": full.angle_sigma_rad, "skew": True})
    off = {changed: 0.0}
    touched = ~same_readings(scan(alone), scan(dataclasses.replace(alone, **off)))
    same = same_readings(scan(full), scan(dataclasses.replace(full, **off)))
    assert same[~touched].all()
    assert not same.all()


@pytest.mark.parametrize("changed", ["range_sigma_m", "range_sigma_ratio"])
def test_changing_the_range_noise_adds_its_own_draws_and_nothing_else(changed):
    quiet = {"range_sigma_m": 0.0, "range_sigma_ratio": 0.0, "mixed_pixel": 0.0}
    base = NoiseConfig(**{**SETTINGS, **quiet})
    alone = NoiseConfig(angle_sigma_rad=base.angle_sigma_rad, skew=True)
    on = {changed: SETTINGS[changed]}
    before, after = scan(base).astype(np.float64), scan(dataclasses.replace(base, **on)).astype(np.float64)
    kept = np.isfinite(before) & (before < LIDAR.range_max_m - 1.0)
    with np.errstate(invalid="ignore"):
        expected = (scan(dataclasses.replace(alone, **on)) - scan(alone).astype(np.float64))[kept]
        np.testing.assert_allclose((after - before)[kept], expected, atol=0.0011)
    assert np.array_equal(np.isnan(before), np.isnan(after))


def same_readings(a, b):
    return np.equal(a, b) | (np.isnan(a) & np.isnan(b))


def test_the_same_seed_gives_the_same_bytes_however_reading_is_cut():
    scene = make_scene(room(), np.zeros(len(room()), dtype=np.int8))
    run = scan_run(scene, trajectory(), LIDAR, NOISE_PRESETS["high"], seed=5)
    whole = run.read_ranges(0, NUM_SCANS)
    parts = [run.read_ranges(a, b) for a, b in ((0, 1), (1, 130), (130, 131), (131, NUM_SCANS))]
    assert whole.tobytes() == np.concatenate(parts).tobytes()
    assert run.read_ranges(7, 7).shape == (0, LIDAR.num_beams)


def test_another_seed_or_another_robot_gives_other_noise():
    noise = NOISE_PRESETS["realistic"]
    first = scan(noise, seed=1)
    assert not np.array_equal(first, scan(noise, seed=2), equal_nan=True)
    assert not np.array_equal(first, scan(noise, path=trajectory(robot="robot_1")), equal_nan=True)


@pytest.mark.parametrize("noise", NOISE_PRESETS.values(), ids=NOISE_PRESETS)
def test_ranges_are_whole_millimetres_within_the_sensors_span(noise):
    ranges = scan(noise)
    finite = ranges[np.isfinite(ranges)].astype(np.float64)
    assert np.abs(finite * 1000.0 - np.round(finite * 1000.0)).max() < 1e-3
    assert finite.min() >= LIDAR.range_min_m
    assert finite.max() <= LIDAR.range_max_m


def test_range_noise_is_gaussian_with_the_sigmas_that_were_asked_for():
    still = trajectory(2000, still=True)
    true = scan(TRUE, path=still).astype(np.float64)
    for noise, sigma in (
        (NoiseConfig(range_sigma_m=0.03), np.full(true.shape, 0.03)),
        (NoiseConfig(range_sigma_ratio=0.02), 0.02 * true),
    ):
        with np.errstate(invalid="ignore"):
            z = ((scan(noise, path=still) - true) / sigma)[np.isfinite(true)]
        assert abs(z.mean()) < 0.02
        assert z.std() == pytest.approx(1.0, abs=0.02)
        assert np.mean(np.abs(z) > 3.0) == pytest.approx(0.0027, abs=0.0007)


def test_dropout_and_misses_happen_as_often_as_asked():
    true = scan(TRUE)
    returned = np.isfinite(true)
    assert np.isnan(scan(NoiseConfig(dropout=0.1))[returned]).mean() == pytest.approx(0.1, abs=0.01)
    expected = 0.8 * np.mean((true[returned] / LIDAR.range_max_m) ** 2)
    missed = np.isposinf(scan(NoiseConfig(max_range_miss=0.8))[returned]).mean()
    assert missed == pytest.approx(expected, rel=0.1)


def test_incidence_loses_grazing_beams_first():
    """Along one long wall, steeper beams return and grazing ones do not."""
    walls, still = np.array([[[-60.0, 1.0], [60.0, 1.0]]]), np.broadcast_to(np.eye(3), (500, 3, 3))
    path = Trajectory("robot_0", 0.1 * np.arange(500), still, still)
    lidar = LidarSpec(180, 0.0, math.radians(1.0), 0.1, 60.0)
    lost = np.isposinf(scan(NoiseConfig(incidence_loss=1.0), lidar=lidar, walls=walls, path=path)).mean(axis=0)
    assert lost[85:96].max() < 0.01
    assert lost[3:6].mean() == pytest.approx(np.mean((1 - np.sin(np.radians([3, 4, 5]))) ** 4), abs=0.05)


def test_mixed_pixels_lie_between_the_two_surfaces_of_an_edge():
    still = trajectory(still=True)
    true, mixed = scan(TRUE, path=still), scan(NoiseConfig(mixed_pixel=0.5), path=still)
    beams = np.flatnonzero((mixed != true).any(axis=0) & np.isfinite(true[0]))
    assert len(beams) > 0
    for b in beams:
        neighbours = true[0, max(b - 1, 0) : b + 2]
        finite = neighbours[np.isfinite(neighbours)]
        assert np.abs(np.diff(finite)).max() > 0.3
        assert (mixed[:, b] >= finite.min() - 0.001).all()
        assert (mixed[:, b] <= finite.max() + 0.001).all()


def test_glass_lets_beams_through_but_for_those_that_meet_it_squarely():
    walls = np.array([[[2.0, -9.0], [2.0, 9.0]], [[4.0, -30.0], [4.0, 30.0]]])
    materials = np.array([Material.GLASS, Material.WALL], dtype=np.int8)
    path = Trajectory("robot_0", np.zeros(1), np.eye(3)[None], np.eye(3)[None])
    lidar = LidarSpec(121, -math.pi / 3, math.radians(1.0), 0.1, 30.0)
    ranges = scan(NoiseConfig(glass=1.0), lidar=lidar, walls=walls, materials=materials, path=path)[0]
    degrees = np.round(np.degrees(lidar.angles_rad))
    expected = np.where(np.abs(degrees) < 8, 2.0, 4.0) / np.cos(np.radians(degrees))
    clear = np.abs(np.abs(degrees) - 8) > 0.5
    np.testing.assert_allclose(ranges[clear], expected[clear], atol=0.001)


def test_skew_casts_each_beam_from_where_the_robot_was_at_its_time():
    lidar = dataclasses.replace(LIDAR, time_increment_s=0.0005, T_robot_lidar=(0.0, 0.0, 0.0))
    path = trajectory()
    ranges = scan(NoiseConfig(skew=True), lidar=lidar, path=path)
    poses = se2.parameters_of(path.T_world_robot)
    grid, k = build_segment_grid(room()), 100
    share = np.arange(lidar.num_beams) * lidar.time_increment_s / 0.1
    between = poses[k] + share[:, None] * (poses[k + 1] - poses[k])
    expected = cast_rays(grid, between[:, :2], between[:, 2] + lidar.angles_rad, lidar.range_max_m).ranges_m
    np.testing.assert_allclose(ranges[k], expected, atol=0.0006)


def test_skew_does_nothing_to_a_robot_that_stands():
    still = trajectory(still=True)
    assert np.array_equal(scan(TRUE, path=still), scan(NoiseConfig(skew=True), path=still))


def test_people_are_seen_where_they_are_at_the_time_of_the_scan():
    def places(stamps_s):
        return np.stack([np.stack([2.0 + stamps_s, np.zeros_like(stamps_s)], axis=-1)], axis=1)

    walls, still = np.array([[[9.0, -9.0], [9.0, 9.0]]]), np.broadcast_to(np.eye(3), (3, 3, 3))
    path = Trajectory("robot_0", np.array([0.0, 1.0, 2.0]), still, still)
    lidar = LidarSpec(1, 0.0, 0.1, 0.1, 12.0)
    ranges = scan(TRUE, lidar=lidar, walls=walls, path=path, obstacles=(np.array([0.25]), places))
    np.testing.assert_allclose(ranges[:, 0], [1.75, 2.75, 3.75], atol=0.0006)


@pytest.mark.parametrize("name", [name for name in EFFECTS if name != "skew"])
@pytest.mark.parametrize("value", [-0.01, math.nan])
def test_impossible_noise_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"noise: {name} must be in .*got"):
        NoiseConfig(**{name: value})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_beams": 0}, "num_beams must be >= 1, got 0"),
        ({"num_beams": 100_000, "angle_increment_rad": 2e-5}, "num_beams must be in .*, got 100000"),
        ({"angle_increment_rad": 1e-300}, "steps of at least"),
        ({"range_min_m": 13.0}, "range_min_m < range_max_m"),
        ({"range_max_m": math.inf}, "range_max_m"),
        ({"time_increment_s": -1.0}, "time_increment_s must be in"),
        ({"time_increment_s": 0.1}, "time_increment_s must be in .* scan_period_s"),
        ({"scan_period_s": 0.0}, "scan_period_s must be in"),
        ({"scan_period_s": 1e-9}, "scan_period_s must be in"),
    ],
)
def test_an_impossible_lidar_is_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        scan(TRUE, lidar=dataclasses.replace(LIDAR, **change))


def test_obstacles_without_radii_are_refused():
    with pytest.raises(ValueError, match="both radii and places"):
        make_scene(room(), np.zeros(7, dtype=np.int8), np.array([0.2]), None)
