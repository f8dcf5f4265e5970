"""Generated buildings: sound, different, as asked for, and the same for the same seed."""

import numpy as np
import pytest

from sim.buildings.floor_plan import OfficeConfig
from sim.buildings.floor_shape import Style
from sim.buildings.free_space import measure_free_space
from sim.buildings.furnishing import FurnishConfig
from sim.buildings.world import World, read_world


def office(seed: int, **fields: object) -> World:
    return read_world("office", office=OfficeConfig(**fields), seed=seed)  # type: ignore[arg-type] # by name in tests


@pytest.fixture(scope="module")
def offices() -> list[World]:
    return [office(seed) for seed in range(20)]


def test_twenty_seeds_give_twenty_different_buildings(offices: list[World]) -> None:
    sizes = {tuple(np.round(world.bounds_m, 2)) for world in offices}
    assert len(sizes) == 20
    assert len({len(world.segments) for world in offices}) > 15
    assert len({len(world.rooms) for world in offices}) > 8


def test_in_every_building_a_robot_reaches_every_room_from_every_start(offices: list[World]) -> None:
    for world in offices:
        space = measure_free_space(world.segments)
        reached = space.reachable(world.starts[0], 0.3)
        places = np.array([*world.starts[:, :2], *((room.x_m, room.y_m) for room in world.rooms)])
        rows, cols = space.cells_of(places).T
        assert reached[rows, cols].all(), world.name


def test_buildings_are_as_large_as_offices(offices: list[World]) -> None:
    for world in offices:
        space = measure_free_space(world.segments)
        floor_m2 = np.count_nonzero(space.reachable(world.starts[0], 0.05)) * space.resolution_m**2
        assert 80.0 < floor_m2 < 2500.0, world.name


def test_the_same_seed_gives_the_same_building() -> None:
    assert office(3).segments.tobytes() == office(3).segments.tobytes()


@pytest.mark.parametrize("style", [style for style in Style if style is not Style.ANY])
def test_every_style_can_be_asked_for(style: Style) -> None:
    assert len(office(1, style=style, width_m=30.0, depth_m=24.0).rooms) >= 4


def test_size_and_number_of_rooms_are_as_asked_for() -> None:
    few, many = (office(2, style=Style.LOOP, width_m=40.0, depth_m=30.0, num_rooms=n) for n in (10, 30))
    assert len(few.rooms) < len(many.rooms)
    assert abs(len(many.rooms) - 31) <= 6
    x0, y0, x1, y1 = many.bounds_m
    assert max(x1 - x0, y1 - y0) < np.hypot(41.0, 31.0)


def test_a_building_of_no_given_size_grows_with_its_rooms_and_an_impossible_number_is_refused() -> None:
    assert abs(len(office(1, style=Style.SPINE, num_rooms=50).rooms) - 51) <= 16
    with pytest.raises(ValueError, match=r"office\.num_rooms=80: the building has place for \d+ rooms"):
        office(1, style=Style.HALL, num_rooms=80)


def test_clutter_can_be_left_out_without_moving_a_wall() -> None:
    config = OfficeConfig(style=Style.SPINE)
    bare = read_world("office", office=config, furnish=FurnishConfig(furniture=0.0, clutter=0.0), seed=4)
    full = read_world("office", office=config, seed=4)
    assert bare.bounds_m == full.bounds_m
    assert len(bare.segments) < 0.5 * len(full.segments)


@pytest.mark.parametrize(("field", "value"), [("width_m", 3.0), ("corridor_m", 0.5), ("num_rooms", 0), ("glass", 2.0)])
def test_impossible_buildings_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"office.{field}"):
        OfficeConfig(**{field: value})  # type: ignore[arg-type] # wrong on purpose
