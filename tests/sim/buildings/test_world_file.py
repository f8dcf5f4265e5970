"""World files: what is written comes out, and each fault is named."""

import math
from pathlib import Path

import numpy as np
import pytest

from sim.buildings.plan import Material
from sim.buildings.world import read_world

BOX = "walls:\n  - [[0, 0], [8, 0], [8, 6], [0, 6], [0, 0]]\n"
STARTS = "starts: [[2, 3, 90]]\n"
DIVIDED = BOX + "  - [[4, 0], [4, 6]]\n"


def write(folder: Path, text: str) -> str:
    path = folder / "house.yaml"
    path.write_text(text)
    return str(path)


def test_a_wall_has_two_faces_a_thickness_apart(tmp_path: Path) -> None:
    world = read_world(write(tmp_path, "thickness: 0.2\n" + BOX + STARTS))
    assert world.name == "house"
    assert world.bounds_m == pytest.approx((-0.1, -0.1, 8.1, 6.1))
    at_left = world.segments[np.all(np.abs(world.segments[:, :, 0]) < 0.11, axis=1)][:, 0, 0]
    assert set(np.round(at_left, 6)) == {-0.1, 0.1}


def test_starts_are_given_in_degrees(tmp_path: Path) -> None:
    world = read_world(write(tmp_path, BOX + STARTS))
    assert world.starts == pytest.approx(np.array([[2.0, 3.0, math.pi / 2]]))


def test_a_door_is_a_gap_of_its_width(tmp_path: Path) -> None:
    world = read_world(write(tmp_path, DIVIDED + "doors: [{at: [4, 2], width: 0.9}]\nrooms: [{at: [6, 3]}]\n" + STARTS))
    crossing = [s for s in world.segments if abs(s[:, 0] - 4.0).max() < 0.08 and s[:, 0].std() > 0.01]
    assert sorted(round(float(s[0, 1]), 6) for s in crossing if 1.0 < s[0, 1] < 3.0) == [1.55, 2.45]


def test_a_leaf_hangs_in_its_door_and_is_a_door(tmp_path: Path) -> None:
    doors = "doors: [{at: [4, 2], width: 0.9, open: 90}]\nrooms: [{at: [6, 3]}]\n"
    world = read_world(write(tmp_path, DIVIDED + doors + STARTS))
    leaf = world.segments[world.materials == Material.DOOR].reshape(-1, 2)
    # The wall runs upwards, so the left is the side of smaller x.
    assert leaf[:, 0].min() == pytest.approx(4.0 - 0.86, abs=0.01)
    assert leaf[:, 1].min() == pytest.approx(1.55, abs=0.01)


def test_materials_are_kept(tmp_path: Path) -> None:
    text = BOX + "  - {points: [[0, 4], [3, 4]], material: glass}\n"
    text += "furniture: [{box: [5, 3, 1, 1]}, {disc: [7, 3, 0.2], material: clutter}]\n"
    world = read_world(write(tmp_path, text + STARTS))
    assert {Material(m) for m in world.materials} == {
        Material.WALL,
        Material.GLASS,
        Material.FURNITURE,
        Material.CLUTTER,
    }


def test_furnishing_more_gives_more_and_keeps_the_room_reachable(tmp_path: Path) -> None:
    room = "rooms: [{name: office, rect: [4, 0, 8, 6], furnish: office}]\ndoors: [{at: [4, 3], width: 0.9}]\n"
    from sim.buildings.furnishing import FurnishConfig  # noqa: PLC0415 (only this test furnishes)

    path = write(tmp_path, DIVIDED + room + STARTS)
    bare = read_world(path, furnish=FurnishConfig(furniture=0.0, clutter=0.0))
    full = read_world(path, furnish=FurnishConfig(furniture=3.0, clutter=3.0))
    assert not np.isin(bare.materials, (Material.FURNITURE, Material.CLUTTER)).any()
    assert np.isin(full.materials, (Material.FURNITURE, Material.CLUTTER)).sum() > 40


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "no fields"),
        ("walls: [", "not YAML"),
        ("walls: 2001-99-99\n" + STARTS, "not YAML"),
        ("walls: " + 5000 * "[", "not YAML"),
        ("walls: []\n" + STARTS, "no walls"),
        (BOX + "  - {arc: [4, 3, 1, 0, 1.0e+9]}\n" + STARTS, r"walls\[1\].arc must be at most a full turn, got 1e\+09"),
        (BOX + STARTS + "walsl: 1\n", "unknown field 'walsl'"),
        (BOX, "no place where a robot can start"),
        (BOX + "  - [[1, 1], [1000000, 1]]\n" + STARTS, "too large: at most 100000 m²"),
        ("walls:\n  - [[0, 0], [8, 0], [8, 6], [0, 6]]\n" + STARTS, "outline is open"),
        (BOX + "starts: [[2, 0.05, 0]]\n", "start 0 at .* is inside a wall"),
        (BOX + "starts: [[20, 3, 0]]\n", "start 0 at .* is outside the building"),
        (BOX + STARTS + "furniture: [{box: [2, 3, 2, 2]}]\n", "start 0 at .* is inside a wall or a piece of furniture"),
        (DIVIDED + STARTS + "rooms: [{name: cell, at: [6, 3]}]\n", "room 'cell' at .* cannot be reached"),
        (DIVIDED + STARTS + "doors: [{at: [4, 2], width: 0.2}]\nrooms: [{at: [6, 3]}]\n", "too narrow"),
        (BOX + STARTS + "doors: [{at: [4, 3], width: 1}]\n", r"doors\[0\] at .* lies on no wall"),
        (BOX + STARTS + "doors: [{at: [4, 0], width: -1}]\n", r"doors\[0\].width must be > 0"),
        (BOX + "  - [[1, 1], [1, 1]]\n" + STARTS, r"walls\[1\].* has no length"),
        (BOX + "  - [[1, 1], [1, .nan]]\n" + STARTS, r"walls\[1\].points\[1\] must be 2 finite numbers"),
        (BOX + "  - {points: [[1, 1], [2, 1]], material: wood}\n" + STARTS, "material must be one of wall, glass"),
        (BOX + STARTS + "furniture: [{bax: [1, 1, 1, 1]}]\n", r"furniture\[0\] has an unknown field 'bax'"),
        (BOX + STARTS + "rooms: [{at: [1, 1], furnish: casino}]\n", "furnish must be one of"),
        (BOX + STARTS + "rooms: [{rect: [4, 0, 1, 6]}]\n", "x0 < x1"),
        (
            BOX + STARTS + "rooms: [{name: r, rect: [20, 0, 30, 6], furnish: lab}]\n",
            "room 'r' lies outside the building",
        ),
        (
            BOX + STARTS + "rooms: [{name: r, rect: [1, -9, 2, -7], furnish: lab}]\n",
            "room 'r' lies outside the building",
        ),
        (BOX + STARTS + "waypoints: [[1, 2]]\n", r"waypoints\[0\]"),
    ],
)
def test_each_fault_is_named_with_its_file(tmp_path: Path, text: str, fault: str) -> None:
    with pytest.raises(ValueError, match=fault) as error:
        read_world(write(tmp_path, text))
    assert str(error.value).startswith(str(tmp_path / "house.yaml"))
    assert "\n" not in str(error.value)


def test_a_missing_file_and_an_unknown_name_are_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"nowhere.yaml: no such file"):
        read_world(str(tmp_path / "nowhere.yaml"))
    with pytest.raises(ValueError, match="world 'atlantis' is unknown: give one of fr079, intel, tim, office"):
        read_world("atlantis")


@pytest.mark.parametrize("name", ["tim", "intel", "fr079"])
def test_the_bundled_worlds_are_sound_and_the_same_every_time(name: str) -> None:
    first, second = read_world(name), read_world(name)
    assert first.segments.tobytes() == second.segments.tobytes()
    assert len(first.rooms) >= 8
    assert len(first.starts) >= 4
    assert {Material.WALL, Material.FURNITURE, Material.CLUTTER, Material.DOOR} <= {
        Material(m) for m in first.materials
    }
