"""People walk on the floor, give way to robots, and walk each their own way."""

import numpy as np
import numpy.typing as npt
import pytest

from sim.buildings.world import World
from sim.robots.crowd import Crowd
from sim.robots.drive import DriveConfig, drive
from sim.robots.people import PeopleConfig
from sim.robots.routing import Router

RADIUS_M, STEP_S, NUM_STEPS = 0.3, 0.05, 1200


def walk(router: Router, num_people: int, robots: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(S, P, 2) where people are at each step, beside robots that stand."""
    rngs = [np.random.default_rng([7, k]) for k in range(num_people)]
    crowd = Crowd(router, PeopleConfig(num_people, mean_pause_s=3.0), robots, rngs)
    places = [crowd.positions.copy()]
    for _ in range(NUM_STEPS):
        crowd.walk(robots, STEP_S)
        places.append(crowd.positions.copy())
    return np.array(places)


def test_people_stay_on_the_floor_walk_no_faster_than_they_may_and_get_about(router: Router) -> None:
    places = walk(router, 12, np.zeros((0, 2)))
    rows, cols = router.space.cells_of(places.reshape(-1, 2)).T
    assert (router.space.clearance_m[rows, cols] > 0.2).all()
    steps = np.hypot(*np.moveaxis(np.diff(places, axis=0), -1, 0))
    assert steps.max() <= PeopleConfig().speed_mps * STEP_S + 1e-9
    assert (steps.sum(axis=0) > 5.0).all()


def test_a_person_walks_the_same_way_whoever_else_is_there(router: Router) -> None:
    np.testing.assert_array_equal(walk(router, 5, np.zeros((0, 2)))[:, :2], walk(router, 2, np.zeros((0, 2))))


def test_nobody_walks_up_to_a_robot(router: Router) -> None:
    robots = np.array([[5.0, 6.0], [9.0, 6.0], [13.0, 6.0]])
    places = walk(router, 12, robots)
    away = np.sqrt(((places[:, :, None] - robots) ** 2).sum(axis=-1)).min(axis=2)
    assert away.min() > 0.5


def test_legs_swing_about_the_body(router: Router) -> None:
    rngs = [np.random.default_rng(k) for k in range(4)]
    crowd = Crowd(router, PeopleConfig(4, mean_pause_s=0.0), np.zeros((0, 2)), rngs)
    gaps = []
    for _ in range(200):
        crowd.walk(np.zeros((0, 2)), STEP_S)
        legs = crowd.legs().reshape(4, 2, 2)
        np.testing.assert_allclose(legs.mean(axis=1), crowd.positions, atol=1e-12)
        gaps.append(np.hypot(*(legs[:, 0] - legs[:, 1]).T))
    assert np.min(gaps) == pytest.approx(0.2, abs=0.01)
    assert np.max(gaps) == pytest.approx(np.hypot(0.2, 0.36), abs=0.01)


def test_more_people_than_have_room_are_refused_with_the_number_that_has(world: World) -> None:
    config = DriveConfig(people=PeopleConfig(num_people=1000), duration_s=1.0)
    with pytest.raises(ValueError, match=r"num_people must be at most \d+ in world 'tim' .*, got 1000"):
        drive(world, config, 1, 0.2, 0)
