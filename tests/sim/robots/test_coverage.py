"""Tours and ways: short, complete, shared out, and never through a wall."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.buildings.free_space import measure_free_space
from sim.buildings.grid_paths import grid_graph, search_nearest
from sim.buildings.plan import box
from sim.buildings.world import World
from sim.robots.coverage import CoverageConfig, Roadmap, more_visits, plan_tours, spread_places
from sim.robots.errands import tour_errands
from sim.robots.routing import Router
from sim.robots.tour import shorten_tour
from sim.robots.work import place_robots

RADIUS_M = 0.3


def length(distance: np.ndarray, tour: np.ndarray) -> float:
    return float(distance[tour[:-1], tour[1:]].sum())


@given(seed=st.integers(0, 10_000), num_places=st.integers(1, 12))
@settings(max_examples=40)
def test_a_tour_visits_each_place_once_and_reversing_a_part_never_shortens_it(seed: int, num_places: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 10.0, (num_places, 2))
    distance = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    tour = shorten_tour(distance, np.arange(num_places))
    assert tour[0] == 0
    assert sorted(tour) == list(range(num_places))
    for i, j in itertools.combinations(range(1, num_places + 1), 2):
        other = np.concatenate([tour[:i], tour[i:j][::-1], tour[j:]])
        assert length(distance, tour) <= length(distance, other) + 1e-9


def test_clearances_agree_with_a_box_of_known_size() -> None:
    corners = box(0.0, 0.0, (4.0, 3.0))
    space = measure_free_space(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
    rows, cols = np.indices(space.clearance_m.shape)
    points = space.centers_of(np.stack([rows, cols], axis=-1))
    inside = (np.abs(points) < (1.95, 1.45)).all(axis=-1)
    exact = np.minimum(2.0 - np.abs(points[..., 0]), 1.5 - np.abs(points[..., 1]))
    np.testing.assert_allclose(space.clearance_m[inside], exact[inside], atol=0.021)


def test_a_way_keeps_its_clearance_and_joins_its_ends(world: World, router: Router) -> None:
    nodes = [router.node_at(np.array([room.x_m, room.y_m])) for room in world.rooms]
    for start, goal in itertools.pairwise(nodes):
        path = router.route(start, goal)
        np.testing.assert_allclose(path[[0, -1]], router.point_of(np.array([start, goal])))
        assert np.hypot(*np.diff(path, axis=0).T).max() < 0.3
        rows, cols = router.space.cells_of(path).T
        assert router.space.clearance_m[rows, cols].min() > RADIUS_M


def test_a_way_around_a_disc_stays_outside_it(router: Router) -> None:
    start, goal = router.node_at(np.array([14.0, 6.0])), router.node_at(np.array([17.0, 9.5]))
    free = router.route(start, goal)
    center = free[len(free) // 2]
    around = router.route(start, goal, avoid=[(center, 0.5)])
    assert np.hypot(*(around - center).T).min() > 0.4
    assert np.hypot(*(free - center).T).min() < 0.1


def test_no_way_is_an_empty_path(router: Router) -> None:
    goal = router.node_at(np.array([1.0, 1.0]))
    start = router.node_at(np.array([16.0, 6.0]))
    assert len(router.route(start, goal, avoid=[(np.array([3.6, 5.0]), 0.6), (np.array([4.5, 1.6]), 0.6)])) == 0


def test_every_reachable_place_is_near_a_visited_one(world: World, router: Router) -> None:
    roadmap = spread_places(router, world.rooms, world.starts, 2.5)
    cost, _ = search_nearest(router.graph, roadmap.nodes)
    assert cost[router.passable.ravel()].max() <= 1.5 * 2.5
    plain = grid_graph(router.passable, np.full(router.passable.shape, router.space.resolution_m))
    assert search_nearest(plain, roadmap.nodes)[0][router.passable.ravel()].max() <= 1.5 * 2.5


@pytest.mark.parametrize("num_robots", [1, 2, 4])
def test_all_places_are_shared_out_and_some_twice(world: World, router: Router, num_robots: int) -> None:
    starts = place_robots(world, router, num_robots, RADIUS_M)
    roadmap = spread_places(router, world.rooms, starts, 2.5)
    tours = plan_tours(roadmap, num_robots, CoverageConfig(shared=0.3), np.random.default_rng(0))
    visited = np.concatenate(tours)
    assert set(visited) | set(range(num_robots)) == set(range(len(roadmap.nodes)))
    assert (len(visited) > len(set(visited))) == (num_robots > 1)


def test_more_starts_than_given_are_found_apart(world: World, router: Router) -> None:
    starts = place_robots(world, router, 8, RADIUS_M)
    away = np.hypot(*(starts[:, None, :2] - starts[None, :, :2]).transpose(2, 0, 1)) + 99.0 * np.eye(8)
    assert away.min() > 1.5
    np.testing.assert_array_equal(starts[:4], world.starts)


def test_more_robots_than_have_room_are_refused_with_the_number_that_has(world: World, router: Router) -> None:
    with pytest.raises(ValueError, match=r"num_robots must be at most \d+ in world 'tim', .*, got 400") as refusal:
        place_robots(world, router, 400, RADIUS_M)
    most = int(str(refusal.value).split("at most ")[1].split()[0])
    assert len(place_robots(world, router, most, RADIUS_M)) == most


@given(
    seed=st.integers(0, 10_000),
    num_places=st.integers(1, 9),
    num_robots=st.integers(1, 9),
    passes=st.integers(1, 3),
    shared=st.sampled_from([0.0, 0.3, 1.0]),
)
def test_however_many_robots_share_few_places_nobody_stands_idle(
    seed: int, num_places: int, num_robots: int, passes: int, shared: float
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 10.0, (max(num_places, num_robots), 2))
    roadmap = Roadmap(np.arange(len(points)), np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)))
    tours = plan_tours(roadmap, num_robots, CoverageConfig(shared=shared, passes=passes), rng)
    visited = set(range(num_robots)).union(*tours)
    assert visited == set(range(len(points)))
    for k, tour in enumerate(tours):
        way = [place for place, _ in itertools.islice(tour_errands(roadmap, k, tour, rng), 30)]
        assert len(way) == 30
        assert len(set(way[15:])) >= min(2, len(points))


def test_another_pass_visits_the_same_places(world: World, router: Router) -> None:
    roadmap = spread_places(router, world.rooms, world.starts[:1], 2.5)
    (tour,) = plan_tours(roadmap, 1, CoverageConfig(), np.random.default_rng(0))
    again = more_visits(roadmap, tour, np.random.default_rng(1))
    assert set(again) | {tour[-1]} == set(tour)
    assert list(again) != list(tour)
