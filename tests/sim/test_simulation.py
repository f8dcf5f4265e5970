"""Robots at work: they see every room, touch nothing, give way, and do the same again for the same seed."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import cKDTree

from merger import se2
from sim.buildings.floor_plan import OfficeConfig
from sim.buildings.free_space import measure_free_space, sample_segments
from sim.buildings.plan import Plan, Room, Solid, box
from sim.buildings.world import Material, World, make_world, read_world
from sim.robot_run import LidarSpec
from sim.robots.coverage import CoverageConfig
from sim.robots.drive import Drive, DriveConfig, drive
from sim.robots.driver import Driver, Mode
from sim.robots.people import MovingDiscs, PeopleConfig
from sim.robots.robot import Robot, RobotConfig, make_space
from sim.robots.routing import Router
from sim.robots.stepping import Clock, run_space
from sim.sensors.odometry import OdometryConfig
from sim.simulation import Sensor, simulate

RADIUS_M = RobotConfig().radius_m


def positions(simulation: Drive, robot: int) -> npt.NDArray[np.float64]:
    """(N, 2) where a robot was at its scans."""
    return simulation.trajectories[robot].T_world_robot[:, :2, 2]


def two_rooms(door_m: float) -> World:
    """Two rooms of 5 x 5 m with a door between them, and a start in each."""
    outer = [(5, 0, 10.2, 0.2), (5, 5, 10.2, 0.2), (0, 2.5, 0.2, 5.2), (10, 2.5, 0.2, 5.2)]
    half = (5.0 - door_m) / 2.0
    inner = [(5, half / 2.0, 0.2, half), (5, 5.0 - half / 2.0, 0.2, half)]
    solids = tuple(Solid(box(x, y, (w, d)), Material.WALL) for x, y, w, d in [*outer, *inner])
    starts = np.array([[2.0, 2.5, 0.0], [8.0, 2.5, np.pi]])
    return make_world(Plan("two rooms", solids, (Room("left", 1.0, 1.0), Room("right", 9.0, 4.0)), starts))


WORLDS = {
    "tim": lambda: read_world("tim"),
    "fr079": lambda: read_world("fr079"),
    "office 7": lambda: read_world("office", seed=7, office=OfficeConfig(width_m=24.0, depth_m=20.0)),
    "office 8": lambda: read_world("office", seed=8, office=OfficeConfig(width_m=26.0, depth_m=18.0)),
}


@pytest.fixture(scope="module", params=list(WORLDS))
def run(request: pytest.FixtureRequest) -> tuple[World, Drive]:
    """Three robots and two people in a building, until all is seen."""
    world = WORLDS[request.param]()
    return world, drive(world, DriveConfig(people=PeopleConfig(num_people=2)), 3, 0.1, 3)


def test_no_robot_ever_touches_a_surface(run: tuple[World, Drive]) -> None:
    world, simulation = run
    surfaces = cKDTree(sample_segments(world.segments, 0.01))
    for robot in range(3):
        steps = simulation.moving.positions_m[:, robot]
        inside = steps[np.abs(steps).max(axis=1) < 1e5]
        assert surfaces.query(inside)[0].min() > RADIUS_M - 1e-4


@pytest.mark.parametrize("acceleration_mps2", [0.05, 0.3])
def test_a_fast_robot_with_weak_brakes_touches_no_surface_either(acceleration_mps2: float) -> None:
    world, robot = read_world("tim"), RobotConfig(max_speed_mps=3.0, acceleration_mps2=acceleration_mps2)
    simulation = drive(world, DriveConfig(robot=robot, duration_s=60.0), 2, 0.2, 0)
    places = simulation.moving.positions_m.reshape(-1, 2)
    assert cKDTree(sample_segments(world.segments, 0.01)).query(places)[0].min() > RADIUS_M - 1e-4
    assert np.hypot(*np.ptp(positions(simulation, 0), axis=0)) > 5.0


def test_no_robot_ever_touches_another(run: tuple[World, Drive]) -> None:
    steps = run[1].moving.positions_m
    for a, b in ((0, 1), (0, 2), (1, 2)):
        both = (np.abs(steps[:, a]).max(axis=1) < 1e5) & (np.abs(steps[:, b]).max(axis=1) < 1e5)
        assert np.hypot(*(steps[both, a] - steps[both, b]).T).min() > 2.0 * RADIUS_M


def test_every_room_is_visited(run: tuple[World, Drive]) -> None:
    world, simulation = run
    seen = cKDTree(np.concatenate([positions(simulation, k) for k in range(3)]))
    places = np.array([[room.x_m, room.y_m] for room in world.rooms])
    assert seen.query(places)[0].max() < 0.6


def test_a_robot_that_made_way_goes_on_when_the_last_other_one_has_left() -> None:
    segments = two_rooms(1.4).segments
    floor, bodies = measure_free_space(segments), make_space(segments)
    router = Router(floor, floor.reachable(np.array([2.0, 2.5, 0.0]), 0.29), 0.29)
    first, second = (
        Driver(
            Robot(bodies, np.array([x, 2.5, 0.0]), RobotConfig()), router, router.node_at(np.array([x, 2.5])), iter(())
        )
        for x in (2.0, 4.0)
    )
    second.make_way(second.position[None])
    run_space(bodies, [first, second], None, router, Clock(0.2, 30.0))
    assert second.mode is Mode.GONE


def test_robots_share_the_work(run: tuple[World, Drive]) -> None:
    lengths = [np.hypot(*np.diff(positions(run[1], k), axis=0).T).sum() for k in range(3)]
    assert max(lengths) < 4.0 * min(lengths)


def test_speeds_and_stamps_are_those_of_a_robot_and_a_clock(run: tuple[World, Drive]) -> None:
    for k, trajectory in enumerate(run[1].trajectories):
        assert trajectory.robot == f"robot_{k}"
        np.testing.assert_allclose(trajectory.stamps_s, 0.1 * np.arange(len(trajectory.stamps_s)), atol=1e-9)
        speeds = np.hypot(*np.diff(positions(run[1], k), axis=0).T) / 0.1
        assert speeds.max() < RobotConfig().max_speed_mps + 0.01
        turns = se2.angle_of(se2.invert(trajectory.T_world_robot[:-1]) @ trajectory.T_world_robot[1:]) / 0.1
        assert np.abs(turns).max() < RobotConfig().max_turn_radps + 0.05


def test_the_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    world, config = read_world("tim"), DriveConfig(people=PeopleConfig(num_people=1), duration_s=40.0)
    first, again, other = (drive(world, config, 2, 0.1, seed) for seed in (1, 1, 2))
    for a, b in zip(first.trajectories, again.trajectories, strict=True):
        assert a.T_world_robot.tobytes() == b.T_world_robot.tobytes()
        assert a.T_odom_robot.tobytes() == b.T_odom_robot.tobytes()
    assert first.moving.positions_m.tobytes() == again.moving.positions_m.tobytes()
    assert first.moving.positions_m.tobytes() != other.moving.positions_m.tobytes()


def test_another_noise_seed_changes_odometry_alone() -> None:
    world, config = read_world("tim"), DriveConfig(duration_s=20.0)
    first, other = (drive(world, config, 2, 0.1, 1, noise_seed=noise) for noise in (1, 2))
    for a, b in zip(first.trajectories, other.trajectories, strict=True):
        assert a.T_world_robot.tobytes() == b.T_world_robot.tobytes()
        assert not np.allclose(a.T_odom_robot[-1], b.T_odom_robot[-1])


def test_a_given_duration_gives_just_that_many_scans() -> None:
    simulation = drive(read_world("tim"), DriveConfig(duration_s=123 * 0.2), 2, 0.2, 0)
    assert [len(t.stamps_s) for t in simulation.trajectories] == [123, 123]


def test_two_passes_take_about_twice_as_long_and_another_way() -> None:
    world = read_world("tim")
    once, twice = (
        drive(world, DriveConfig(coverage=CoverageConfig(passes=passes)), 1, 0.2, 0).trajectories[0]
        for passes in (1, 2)
    )
    assert 1.6 < len(twice.stamps_s) / len(once.stamps_s) < 2.6


def test_robots_that_must_pass_each_other_in_a_door_both_arrive() -> None:
    world = two_rooms(0.9)
    routes = (np.array([[8.0, 1.0]]), np.array([[2.0, 1.0]]))
    crossing = replace(world, waypoints=routes)
    simulation = drive(crossing, DriveConfig(max_duration_s=120.0), 2, 0.1, 0)
    for k, route in enumerate(routes):
        assert np.hypot(*(positions(simulation, k)[-1] - route[-1])) < 0.4


def test_waypoints_are_followed_in_their_order() -> None:
    route = np.array([[8.0, 4.0], [8.0, 1.0], [2.0, 4.0]])
    simulation = drive(replace(two_rooms(1.0), waypoints=(route,)), DriveConfig(), 1, 0.1, 0)
    away = np.hypot(*(positions(simulation, 0)[:, None] - route[None]).transpose(2, 0, 1))
    assert away.min(axis=0).max() < 0.5
    assert (np.diff(np.argmin(away, axis=0)) > 0).all()


def test_a_waypoint_in_a_wall_is_refused_by_its_place() -> None:
    world = replace(two_rooms(1.0), waypoints=(np.array([[8.0, 4.0], [5.0, 0.5]]),))
    with pytest.raises(ValueError, match=r"the waypoint \(5, 0.5\) cannot be reached"):
        drive(world, DriveConfig(), 1, 0.1, 0)


def test_a_robot_wider_than_the_door_is_refused_by_the_room() -> None:
    with pytest.raises(ValueError, match=r"room 'right' .* cannot be reached by a robot of radius 0.49 m"):
        drive(two_rooms(0.8), DriveConfig(robot=RobotConfig(radius_m=0.45)), 1, 0.1, 0)


@pytest.mark.parametrize(("num_robots", "period", "fault"), [(0, 0.1, "num_robots"), (1, 0.0, "scan_period_s")])
def test_impossible_runs_are_refused_by_name(num_robots: int, period: float, fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        drive(two_rooms(1.0), DriveConfig(), num_robots, period, 0)


def test_two_robots_that_would_start_in_one_place_are_refused_by_their_starts() -> None:
    world = two_rooms(1.0)
    twice = replace(world, starts=np.array([world.starts[0], world.starts[0] + [0.1, 0.0, 0.0]]))
    with pytest.raises(ValueError, match=r"starts 0 and 1 must be 0.55 m apart"):
        drive(twice, DriveConfig(), 2, 0.2, 0)


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: RobotConfig(radius_m=-1.0), "radius_m"),
        (lambda: RobotConfig(max_speed_mps=0.0), "max_speed_mps"),
        (lambda: CoverageConfig(spacing_m=0.0), "spacing_m"),
        (lambda: CoverageConfig(shared=1.5), "shared"),
        (lambda: PeopleConfig(num_people=-1), "num_people"),
        (lambda: CoverageConfig(passes=1_000_000), "passes"),
        (lambda: DriveConfig(duration_s=-1.0), "duration_s"),
        (lambda: DriveConfig(duration_s=7300.0), "duration_s .* max_duration_s = 7200"),
        (lambda: DriveConfig(max_duration_s=1e12), "max_duration_s"),
        (lambda: OdometryConfig(alpha3=-1.0), "alpha3"),
    ],
)
def test_impossible_settings_are_refused_by_name(make: object, fault: str) -> None:
    with pytest.raises(ValueError, match=fault):
        make()  # type: ignore[operator] # a lambda


def test_a_lidar_sees_walls_and_other_robots_but_not_its_own() -> None:
    lidar = LidarSpec(360, -np.pi, np.radians(1.0), 0.05, 30.0, 0.1)
    world = replace(two_rooms(1.0), waypoints=(np.array([[2.0, 2.5]]), np.array([[8.0, 2.5]])))
    runs = simulate(world, DriveConfig(duration_s=0.5), Sensor(lidar), 2, 0)
    ranges = runs[0].read_ranges(0, 1)[0]
    assert ranges[180] == pytest.approx(6.0 - RADIUS_M, abs=0.01)
    assert ranges[0] == pytest.approx(1.9, abs=0.01)
    assert ranges.min() > RADIUS_M


def test_discs_are_interpolated_and_held_at_the_ends() -> None:
    places = np.array([[[0.0, 0.0]], [[1.0, 2.0]], [[1.0, 4.0]]])
    moving = MovingDiscs(np.array([0.0, 1.0, 2.0]), places, np.array([0.1]), np.array([0]))
    found = moving.positions_at(np.array([-1.0, 0.5, 1.0, 1.25, 9.0]))[:, 0]
    np.testing.assert_allclose(found, [[0, 0], [0.5, 1.0], [1, 2], [1, 2.5], [1, 4]])
