"""The floor on which robots and people move."""

import pytest

from sim.buildings.free_space import measure_free_space
from sim.buildings.world import World, read_world
from sim.robots.routing import Router


@pytest.fixture(scope="module")
def world() -> World:
    return read_world("tim")


@pytest.fixture(scope="module")
def router(world: World) -> Router:
    """Ways of robots of 0.3 m radius."""
    space = measure_free_space(world.segments)
    return Router(space, space.reachable(world.starts[0], 0.3), 0.3)
