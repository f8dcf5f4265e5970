"""Right of way: robots wait for what is before them, and of two that face each other one makes way."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim.robots.driver import Driver, Mode
from sim.robots.routing import Router

Array = npt.NDArray[np.float64]

_LOOK_AHEAD_M = 1.2
_MARGIN_M = 0.2
"""Distance between bodies below which a way is blocked."""
_THEIR_WAY_M = 6.0
"""How much of the other's way must be left free by a robot that makes way."""
_PASSED_M = 2.5
_PERSON_M = 0.3
_STEP_BACK_M = 1.5
_PEOPLE_AHEAD_M = 0.8
_APPROACH_M = 0.03
"""A way that comes less than this closer leads past, or away."""
_PATIENCE_S = 6.0
"""After so long a wait a robot looks for another way, and gives up its goal if there is none."""
_MOST_ATTEMPTS = 6
"""So often a robot tries to get around an obstacle, or out of its way."""


def direct_traffic(drivers: Sequence[Driver], people: Array, router: Router, elapsed_s: float) -> None:
    """Decide who holds, who makes way and who goes on.

    Args:
        drivers: All robots in the building, those with the right of way first.
        people: (P, 2) where people stand.
        router: To find a place out of the way.
        elapsed_s: Time since this was last decided.
    """
    blocks = _blockers(drivers)
    for driver, blockers in zip(drivers, blocks, strict=True):
        reach_m = driver.robot.config.radius_m + _PERSON_M
        by_people = len(people) > 0 and bool(_met(driver.path_ahead(_PEOPLE_AHEAD_M), people, reach_m).any())
        driver.hold = by_people or (driver.mode is Mode.TOURING and bool(blockers))
        driver.waited_s = driver.waited_s + elapsed_s if driver.hold or driver.mode is Mode.MAKING_WAY else 0.0
        if driver.mode is Mode.TOURING and not driver.hold:
            driver.attempts = 0
    for k, driver in enumerate(drivers):
        if driver.mode is Mode.MAKING_WAY:
            _go_on_when_passed(driver, drivers, people)
            continue
        for j in range(k + 1, len(drivers)):
            other = drivers[j]
            if other in blocks[k] and driver in blocks[j] and driver.mode is other.mode is Mode.TOURING:
                _settle(driver, other, router)
        if driver.mode is Mode.TOURING and driver.hold and driver.waited_s > _PATIENCE_S:
            _find_other_way(driver, blocks[k], people, router)


def _blockers(drivers: Sequence[Driver]) -> list[list[Driver]]:
    """The robots that stand in each robot's way."""
    places = np.array([driver.position for driver in drivers])
    radii_m = np.array([driver.robot.config.radius_m for driver in drivers])
    blockers = []
    for driver in drivers:
        met = _met(driver.path_ahead(_LOOK_AHEAD_M), places, driver.robot.config.radius_m + radii_m + _MARGIN_M)
        blockers.append([drivers[k] for k in np.flatnonzero(met).tolist() if drivers[k] is not driver])
    return blockers


def _met(way: Array, points: Array, distance_m: Array | float) -> npt.NDArray[np.bool_]:
    """(P,) to which of (P, 2) points a way comes close, and closer than where it begins."""
    away = np.hypot(way[:, 0, None] - points[:, 0], way[:, 1, None] - points[:, 1])
    return np.asarray((away < np.minimum(distance_m, away[0] - _APPROACH_M)).any(axis=0))


def _near(way: Array, points: Array, distance_m: float) -> bool:
    return bool((np.hypot(*np.moveaxis(way[:, None] - points[None], -1, 0)) < distance_m).any())


def _settle(first: Driver, second: Driver, router: Router) -> None:
    """Of two robots that block each other the second makes way, or, if it cannot, the first."""
    for loser, winner in ((second, first), (first, second)):
        reach = first.robot.config.radius_m + second.robot.config.radius_m
        refuge = router.nearest_refuge(
            router.node_at(loser.position),
            winner.path_ahead(_THEIR_WAY_M),
            reach + _MARGIN_M,
            [(winner.position, reach)],
        )
        if len(refuge):
            loser.make_way(refuge)
            loser.waited_s, loser.hold = 0.0, False
            return


def _go_on_when_passed(driver: Driver, drivers: Sequence[Driver], people: Array) -> None:
    robots = np.array([other.position for other in drivers if other is not driver]).reshape(-1, 2)
    here = driver.position[None]
    if driver.waited_s > 2.0 * _PATIENCE_S or not (_near(here, robots, _PASSED_M) or _near(here, people, _STEP_BACK_M)):
        driver.resume()


def _find_other_way(driver: Driver, blockers: Sequence[Driver], people: Array, router: Router) -> None:
    """Go around what blocks the way, or step back, by turns; when nothing helps give up the goal."""
    radius_m = driver.robot.config.radius_m
    avoid = [(other.position, radius_m + other.robot.config.radius_m + _MARGIN_M) for other in blockers]
    avoid += [(person, radius_m + _PERSON_M) for person in people if np.hypot(*(person - driver.position)) < 2.0]
    driver.waited_s = 0.0
    driver.attempts += 1
    if driver.attempts > _MOST_ATTEMPTS or not avoid:
        driver.attempts = 0
        driver.skip_goal()
    elif driver.attempts % 2 == 0 or not driver.resume(avoid):
        obstacles = np.array([center for center, _ in avoid])
        refuge = router.nearest_refuge(router.node_at(driver.position), obstacles, _STEP_BACK_M, avoid)
        if len(refuge):
            driver.make_way(refuge)
