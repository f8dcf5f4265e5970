"""`office`: buildings from a seed, each one different: shape, rooms, doors, furniture, clutter."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sim.buildings.floor_doors import DoorHabits, build_border_walls, place_doors, trace_borders
from sim.buildings.floor_rooms import CELL_M, CORRIDOR, FloorLabels, cut_rooms, label_rects
from sim.buildings.floor_shape import FloorShape, Style, draw_shape
from sim.buildings.furnishing import FurnishConfig, RoomArea, furnish_rooms
from sim.buildings.outlines import outline_segments
from sim.buildings.plan import Plan, Room, Solid
from sim.buildings.room_kinds import RoomKind
from sim.buildings.walls import build_walls
from sim.buildings.world_check import check_plan
from sim.streams import Purpose, make_stream

Array = npt.NDArray[np.float64]

_ATTEMPTS = 20
"""Buildings drawn until one passes the check."""
_NUM_STARTS = 6
_STARTS_APART_M = 2.0
_START_WIDTH_M = 0.4
"""A start is kept free like a door of this width."""
_ROBOT_RADIUS_M = 0.32
"""Generated buildings let a robot of this radius into every room."""
_LARGEST_M = 150.0
_ROOM_SHARE_M2 = (25.0, 60.0)
"""A room with its share of the corridors, and of what the building leaves out of its width times its depth."""
_FEWEST_SHARE = 0.7
"""A building with a smaller share of the rooms that were asked for is another one."""


@dataclass(frozen=True)
class OfficeConfig:
    """What is known of a building before it is drawn; what is not given is drawn, too."""

    style: Style = Style.ANY
    """How the corridors run."""
    width_m: float | None = None
    """Width of the building, in [12, 150]; none: 22 to 46 m."""
    depth_m: float | None = None
    """Depth of the building, in [12, 150]; none: 18 to 36 m."""
    num_rooms: int | None = None
    """About so many rooms, in [1, 2000]; none: rooms of usual size. A size that is not given grows with them."""
    corridor_m: float | None = None
    """Width of the corridors, in [1.4, 6]; none: 1.6 to 2.8 m."""
    repeated: float = 0.35
    """Share of the rows of rooms that are cut evenly and furnished alike, in [0, 1]."""
    loops: float = 0.12
    """Probability of a door between two neighbouring rooms, in [0, 1]: every such door closes a loop."""
    glass: float = 0.06
    """Share of the walls along corridors that are of glass, in [0, 1]."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        limits = {
            "width_m": (12.0, _LARGEST_M),
            "depth_m": (12.0, _LARGEST_M),
            "corridor_m": (1.4, 6.0),
            "num_rooms": (1, 2000),
        }
        limits |= {"repeated": (0.0, 1.0), "loops": (0.0, 1.0), "glass": (0.0, 1.0)}
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"office.{name} must be in [{low:g}, {high:g}], got {value}")


def draw_office(config: OfficeConfig, furnish: FurnishConfig, seed: int) -> Plan:
    """Draw a building.

    Args:
        config: What it must be like.
        furnish: How full its rooms are.
        seed: The same seed and config give the same building.

    Raises:
        ValueError: no building that robots can work in was found (the config asks for the impossible).
    """
    fault = ""
    for attempt in range(_ATTEMPTS):
        try:
            plan = _draw(config, furnish, f"office_{seed}", make_stream(seed, Purpose.WORLD, attempt))
            check_plan(plan, outline_segments(plan.solids)[0], _ROBOT_RADIUS_M)
        except ValueError as error:
            fault = str(error)
        else:
            return plan
    raise ValueError(f"no office building fits the configuration in {_ATTEMPTS} attempts; the last: {fault}")


def _draw(config: OfficeConfig, furnish: FurnishConfig, name: str, rng: np.random.Generator) -> Plan:
    size_m = _draw_size(config, rng)
    corridor_m = config.corridor_m or rng.uniform(1.6, 2.8)
    shape = draw_shape(config.style, size_m, corridor_m, rng)
    floor = _cut(shape, config, rng)
    borders = trace_borders(floor.labels)
    narrow = rng.uniform(0.85, 0.95)
    leaf, closed = rng.uniform(0.2, 0.8), rng.uniform(0.0, 0.5)
    habits = DoorHabits((narrow, narrow + rng.uniform(0.05, 0.3)), config.loops, leaf, closed)
    doors, reached = place_doors(floor, borders, habits, rng)
    halls = set(range(2, 2 + floor.num_halls))
    thickness_m = (rng.uniform(0.1, 0.2), rng.uniform(0.25, 0.4))
    solids = build_walls(build_border_walls(borders, thickness_m, config.glass, halls, rng), doors)
    free = _free_cells(floor.labels.shape, solids)
    areas = [_area(floor, label, free, rng) for label in sorted(reached)]
    starts = _starts(floor, areas, corridor_m, rng)
    openings = [[door.x_m, door.y_m, door.width_m] for door in doors if door.open_rad != 0.0]
    openings += [[x, y, _START_WIDTH_M] for x, y, _ in starts]
    solids += furnish_rooms(areas, solids, np.array(openings), furnish, int(rng.integers(1 << 31)))
    angle = float(rng.choice([0.0, rng.uniform(0.0, math.pi / 2.0)]))
    return _turned(Plan(name, tuple(solids), tuple(a.room for a in areas), starts), angle)


def _draw_size(config: OfficeConfig, rng: np.random.Generator) -> tuple[float, float]:
    """Width and depth; what is not given is drawn, and enlarged as far as the rooms that are wanted need it."""
    width_m, depth_m = config.width_m or rng.uniform(22.0, 46.0), config.depth_m or rng.uniform(18.0, 36.0)
    if config.num_rooms is None:
        return width_m, depth_m
    more = max(config.num_rooms * rng.uniform(*_ROOM_SHARE_M2) / (width_m * depth_m), 1.0)
    if config.width_m is None:
        width_m *= more if config.depth_m else math.sqrt(more)
    if config.depth_m is None:
        depth_m *= more if config.width_m else math.sqrt(more)
    return min(width_m, _LARGEST_M), min(depth_m, _LARGEST_M)


def _cut(shape: FloorShape, config: OfficeConfig, rng: np.random.Generator) -> FloorLabels:
    """Cut into rooms of a usual width, or of the width that comes nearest to the number wanted."""
    seed = int(rng.integers(1 << 31))
    if config.num_rooms is None:
        return cut_rooms(shape, rng.uniform(3.0, 5.5), config.repeated, np.random.default_rng(seed))
    floors = [
        cut_rooms(shape, width_m, config.repeated, np.random.default_rng(seed))
        for width_m in np.geomspace(2.2, 25.0, 9)
    ]
    counts = [len(np.unique(floor.labels)) - 2 - len(shape.halls) for floor in floors]
    if max(counts) < _FEWEST_SHARE * config.num_rooms:
        raise ValueError(f"office.num_rooms={config.num_rooms}: the building has place for {max(counts)} rooms")
    return floors[int(np.argmin(np.abs(np.array(counts) - config.num_rooms)))]


def _free_cells(shape: tuple[int, ...], solids: list[Solid]) -> npt.NDArray[np.bool_]:
    """(H, W) cells of the lattice that no wall and no door leaf touches."""
    drawn = np.zeros(shape, dtype=np.uint8)
    for solid in solids:
        cv2.fillConvexPoly(drawn, np.floor(solid.polygon / CELL_M).astype(np.int32), 1)
    return np.asarray(drawn == 0)


def _area(floor: FloorLabels, label: int, free: npt.NDArray[np.bool_], rng: np.random.Generator) -> RoomArea:
    """The floor of a label, and what it is for."""
    mask = floor.labels == label
    depth = cv2.distanceTransform((mask & free).astype(np.uint8), cv2.DIST_L2, 5)
    row, col = np.unravel_index(int(np.argmax(depth)), depth.shape)
    anchor = Room(f"room {label}", (float(col) + 0.5) * CELL_M, (float(row) + 0.5) * CELL_M)
    kind = _kind(label, floor.num_halls, np.count_nonzero(mask) * CELL_M**2, rng)
    seed = int(rng.integers(1 << 30))
    if label in floor.even:
        seed = (1 << 30) + floor.even[label]
        kind = RoomKind.OFFICE if kind is RoomKind.STORAGE else kind
    return RoomArea(anchor, kind, tuple(label_rects(mask)), seed, float(rng.uniform(0.3, 1.8)))


def _kind(label: int, num_halls: int, area_m2: float, rng: np.random.Generator) -> RoomKind:
    if label == CORRIDOR:
        return RoomKind.CORRIDOR
    if label < 2 + num_halls or area_m2 > 90.0:
        return RoomKind.HALL if rng.random() < 0.6 else RoomKind.LOUNGE
    kinds = [RoomKind.OFFICE, RoomKind.MEETING, RoomKind.LAB, RoomKind.STORAGE, RoomKind.LOUNGE, RoomKind.EMPTY]
    weights = np.array([0.6, 0.1, 0.05, 0.15, 0.05, 0.05] if area_m2 < 25.0 else [0.35, 0.15, 0.3, 0.05, 0.12, 0.03])
    return kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))]


def _starts(floor: FloorLabels, areas: list[RoomArea], corridor_m: float, rng: np.random.Generator) -> Array:
    """Places in the middle of corridors far from each other, then the rooms' own points."""
    corridor = (floor.labels == CORRIDOR).astype(np.uint8)
    depth = cv2.distanceTransform(corridor, cv2.DIST_L2, 5)
    cells = np.argwhere(depth * CELL_M > 0.42 * corridor_m)
    places = (cells[:, ::-1] + 0.5) * CELL_M
    rooms = np.array([[area.room.x_m, area.room.y_m] for area in areas])
    chosen = _far_apart([], np.asarray(places, dtype=np.float64), rng)
    chosen = _far_apart(chosen, rooms, rng)
    headings = rng.uniform(-math.pi, math.pi, len(chosen))
    return np.column_stack([np.array(chosen), headings])


def _far_apart(chosen: list[Array], places: Array, rng: np.random.Generator) -> list[Array]:
    """More of these (M, 2) places, each far from those chosen before, until there are enough or they lie too near."""
    chosen = list(chosen)
    if not chosen and len(places):
        chosen.append(places[int(rng.integers(len(places)))])
    while len(chosen) < _NUM_STARTS and len(places):
        away = np.min([np.hypot(*(places - point).T) for point in chosen], axis=0)
        if away.max() < _STARTS_APART_M:
            break
        chosen.append(places[int(np.argmax(away))])
    return chosen


def _turned(plan: Plan, angle_rad: float) -> Plan:
    """The building turned about the origin."""
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    R_T = np.array([[cosine, sine], [-sine, cosine]])
    solids = tuple(Solid(solid.polygon @ R_T, solid.material) for solid in plan.solids)
    places = np.array([[room.x_m, room.y_m] for room in plan.rooms]) @ R_T
    rooms = tuple(Room(room.name, float(x), float(y)) for room, (x, y) in zip(plan.rooms, places, strict=True))
    starts = np.column_stack([plan.starts[:, :2] @ R_T, plan.starts[:, 2] + angle_rad])
    return Plan(plan.name, solids, rooms, starts)
