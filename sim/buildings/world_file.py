"""World files: a building written by hand, in metres and degrees, as YAML.

A file is a mapping with these fields; only ``walls`` and ``starts`` must be there::

    thickness: 0.15            # of walls that do not say theirs
    walls:                     # centre lines; a wall is solid and has two faces
      - [[0, 0], [8, 0], [8, 6], [0, 6], [0, 0]]                            # short form
      - {points: [[4, 0], [4, 6]], thickness: 0.1, material: glass}         # wall (default) or glass
      - {arc: [4, 3, 2, 90, 180]}                  # centre x, y, radius, and from where to where, in degrees
    doors:                     # a gap in every wall that passes through the point `at`
      - {at: [4, 2], width: 0.9}                    # taken off its hinges
      - {at: [4, 4], width: 0.9, open: 80}          # a leaf, ajar by 80 degrees, to the left of its wall's direction;
                                                    # negative: to the right; 0: closed; `hinge: end` (default: start)
    furniture:                 # solid from the floor to above the lidar
      - {box: [1, 1, 1.6, 0.8], turn: 30}           # centre x, y, width, depth
      - {disc: [2, 2, 0.2]}                         # centre x, y, radius
      - {box: [3, 5, 0.3, 0.3], material: clutter}  # furniture (default), clutter, wall (a pillar), glass
    rooms:                     # places that every robot must be able to reach, and that coverage visits
      - {name: kitchen, at: [1, 5]}
      - {name: lab, rect: [4, 0, 8, 6], furnish: lab, clutter: 0.5}   # between wall centre lines x0, y0, x1, y1;
                               # filled by `furnishing` as office, meeting, lab, storage, lounge, hall or corridor
    starts: [[1, 3, 0]]        # x, y, degrees; the first robots stand here
    waypoints: [[[1, 3], [6, 3]]]     # a route for each robot, instead of planning
    seed: 1                    # of the furnishing
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from sim.buildings.furnishing import FurnishConfig, RoomArea, furnish_rooms
from sim.buildings.plan import Material, Plan, Room, Solid, box, disc
from sim.buildings.room_kinds import RoomKind
from sim.buildings.walls import Door, Wall, build_walls
from sim.buildings.world_check import check_size
from sim.buildings.yaml_fields import check_fields, read_list, read_numbers, read_points, read_positive, read_seed

_FIELDS = {"thickness", "walls", "doors", "furniture", "rooms", "starts", "waypoints", "seed"}
_DEFAULT_THICKNESS_M = 0.15
_CHORD_M = 0.4
_FULL_TURN_DEG = 360.0
_START_WIDTH_M = 0.4
"""A start is kept free like a door of this width."""


class WorldFileError(ValueError):
    """A world file cannot be used; the message is one line that names the file and the fault."""


def read_world_file(path: Path, furnish: FurnishConfig) -> Plan:
    """Read a world file, and furnish its rooms as full as is asked for; its name is the file's stem.

    Raises:
        WorldFileError: the file is missing, empty, not YAML, or a field is missing, unknown or out of range.
    """
    document = _read_document(path)
    try:
        return _plan_of(path.stem, document, furnish)
    except (ValueError, TypeError, KeyError) as error:
        raise WorldFileError(f"{path}: {error}") from None


def is_map_file(path: Path) -> bool:
    """Whether a YAML file describes a `map_server` map (it names an image) and no world.

    Raises:
        WorldFileError: the file is missing, empty or not YAML.
    """
    return "image" in _read_document(path)


def _read_document(path: Path) -> dict[str, Any]:
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise WorldFileError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise WorldFileError(f"{path}: cannot be read ({type(error).__name__})") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise WorldFileError(f"{path}: not YAML ({' '.join(str(error).split())})") from None
    if not isinstance(document, dict):
        raise WorldFileError(f"{path}: neither a world file nor a map (no fields)")
    return document


def _plan_of(name: str, document: dict[str, Any], furnish: FurnishConfig) -> Plan:
    unknown = sorted(set(map(str, document)) - _FIELDS)
    if unknown:
        raise ValueError(f"unknown field '{unknown[0]}'; known are {', '.join(sorted(_FIELDS))}")
    thickness_m = read_positive("thickness", document.get("thickness", _DEFAULT_THICKNESS_M))
    walls = [w for k, item in enumerate(read_list(document, "walls")) for w in _walls(f"walls[{k}]", item, thickness_m)]
    if not walls:
        raise ValueError("there are no walls")
    doors = [_door(f"doors[{k}]", item) for k, item in enumerate(read_list(document, "doors"))]
    furniture = [_furniture(f"furniture[{k}]", item) for k, item in enumerate(read_list(document, "furniture"))]
    solids = build_walls(walls, doors) + furniture
    check_size(name, np.concatenate([solid.polygon for solid in solids]))
    areas = [_room(f"rooms[{k}]", item, k) for k, item in enumerate(read_list(document, "rooms"))]
    seed = read_seed(document.get("seed", 0))
    starts = [read_numbers(f"starts[{k}]", item, 3) for k, item in enumerate(read_list(document, "starts"))]
    openings = [[d.x_m, d.y_m, d.width_m] for d in doors if d.open_rad != 0.0]
    openings += [[x, y, _START_WIDTH_M] for x, y, _ in starts]
    solids += furnish_rooms(areas, solids, np.array(openings).reshape(-1, 3), furnish, seed)
    starts_rad = np.array(starts).reshape(-1, 3) * (1.0, 1.0, math.pi / 180.0)
    routes = tuple(read_points(f"waypoints[{k}]", item) for k, item in enumerate(read_list(document, "waypoints")))
    return Plan(name, tuple(solids), tuple(a.room for a in areas), starts_rad, routes)


def _walls(where: str, item: Any, thickness_m: float) -> list[Wall]:
    fields = item if isinstance(item, dict) else {"points": item}
    check_fields(where, fields, {"points", "arc", "thickness", "material"})
    points = _arc(where, fields["arc"]) if "arc" in fields else read_points(f"{where}.points", fields.get("points"))
    thickness_m = read_positive(f"{where}.thickness", fields.get("thickness", thickness_m))
    material = _material(where, fields.get("material", "wall"), (Material.WALL, Material.GLASS))
    for a, b in pairwise(points):
        if np.hypot(*(b - a)) < 0.01:
            raise ValueError(f"{where}: the piece at ({a[0]:g}, {a[1]:g}) has no length")
    return [Wall(a, b, thickness_m, material) for a, b in pairwise(points)]


def _arc(where: str, value: Any) -> npt.NDArray[np.float64]:
    """(M, 2) points on an arc, chords of about 0.4 m."""
    x, y, radius, first, last = read_numbers(f"{where}.arc", value, 5)
    if abs(last - first) > _FULL_TURN_DEG:
        raise ValueError(f"{where}.arc must be at most a full turn, got {abs(last - first):g} degrees")
    turn = math.radians(last - first)
    count = max(2, math.ceil(abs(turn) * read_positive(f"{where}.arc radius", radius) / _CHORD_M) + 1)
    angles = math.radians(first) + np.linspace(0.0, turn, count)
    return np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], axis=-1)


def _door(where: str, item: Any) -> Door:
    check_fields(where, item, {"at", "width", "open", "hinge"})
    x, y = read_numbers(f"{where}.at", item.get("at"), 2)
    width = read_positive(f"{where}.width", item.get("width"))
    angle = item.get("open")
    open_rad = None if angle is None else math.radians(read_numbers(f"{where}.open", [angle], 1)[0])
    hinge = item.get("hinge", "start")
    if hinge not in ("start", "end"):
        raise ValueError(f"{where}.hinge must be start or end, got '{hinge}'")
    return Door(x, y, width, open_rad, hinge == "end")


def _furniture(where: str, item: Any) -> Solid:
    check_fields(where, item, {"box", "disc", "turn", "material"})
    choices = (Material.FURNITURE, Material.CLUTTER, Material.WALL, Material.GLASS)
    material = _material(where, item.get("material", "furniture"), choices)
    if ("box" in item) == ("disc" in item):
        raise ValueError(f"{where} must have either 'box' or 'disc'")
    if "disc" in item:
        x, y, radius = read_numbers(f"{where}.disc", item["disc"], 3)
        return Solid(disc(x, y, read_positive(f"{where}.disc radius", radius)), material)
    x, y, width, depth = read_numbers(f"{where}.box", item["box"], 4)
    size = (read_positive(f"{where}.box width", width), read_positive(f"{where}.box depth", depth))
    angle = math.radians(read_numbers(f"{where}.turn", [item.get("turn", 0.0)], 1)[0])
    return Solid(box(x, y, size, angle), material)


def _room(where: str, item: Any, k: int) -> RoomArea:
    check_fields(where, item, {"name", "at", "rect", "furnish", "clutter", "seed"})
    name = str(item.get("name", f"room {k}"))
    kind = _kind(where, item.get("furnish", "empty"))
    if "rect" not in item and ("at" not in item or kind != RoomKind.EMPTY):
        raise ValueError(f"{where} needs {'at or rect' if kind == RoomKind.EMPTY else 'a rect to be furnished'}")
    x0, y0, x1, y1 = read_numbers(f"{where}.rect", item["rect"], 4) if "rect" in item else (0.0, 0.0, 1.0, 1.0)
    if not (x0 < x1 and y0 < y1):
        raise ValueError(f"{where}.rect must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
    x, y = read_numbers(f"{where}.at", item["at"], 2) if "at" in item else [(x0 + x1) / 2.0, (y0 + y1) / 2.0]
    clutter = read_numbers(f"{where}.clutter", [item.get("clutter", 1.0)], 1)[0]
    if not 0.0 <= clutter <= 5.0:
        raise ValueError(f"{where}.clutter must be in [0, 5], got {clutter:g}")
    return RoomArea(Room(name, x, y), kind, ((x0, y0, x1, y1),), read_seed(item.get("seed", k)), clutter)


def _kind(where: str, value: Any) -> RoomKind:
    if value not in list(RoomKind):
        raise ValueError(f"{where}.furnish must be one of {', '.join(RoomKind)}, got '{value}'")
    return RoomKind(value)


def _material(where: str, value: Any, choices: tuple[Material, ...]) -> Material:
    names = {m.name.lower(): m for m in choices}
    if value not in names:
        raise ValueError(f"{where}.material must be one of {', '.join(names)}, got '{value}'")
    return names[value]
