"""Fill rooms with furniture and clutter, and keep a way free from every door to the room's own point."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sim.buildings import furniture
from sim.buildings.grid_paths import grid_graph, search, trace_path
from sim.buildings.plan import Array, Room, Solid
from sim.buildings.room_filling import CELL_M, Filler, Mask
from sim.buildings.room_kinds import FURNISHINGS, RoomKind


@dataclass(frozen=True)
class FurnishConfig:
    """How full rooms are."""

    furniture: float = 1.0
    """Pieces of furniture in a room, relative to a normal one; >= 0."""
    clutter: float = 1.0
    """Small things that lie about, relative to a normal room; >= 0."""
    passage_m: float = 1.0
    """Width of the ways that are kept free, metres, >= 0.6."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        for name in ("furniture", "clutter"):
            if not 0.0 <= getattr(self, name) <= 5.0:
                raise ValueError(f"{name} must be in [0, 5], got {getattr(self, name)}")
        if not 0.6 <= self.passage_m <= 3.0:
            raise ValueError(f"passage_m must be in [0.6, 3] m, got {self.passage_m}")


@dataclass(frozen=True)
class RoomArea:
    """The floor of one room."""

    room: Room
    """Its name and the point that stays free."""
    kind: RoomKind
    """What it is for."""
    rects: tuple[tuple[float, float, float, float], ...]
    """x0, y0, x1, y1 in metres, together the room's floor (walls may stand in it)."""
    seed: int
    """Rooms of equal shape and seed are furnished alike."""
    clutter: float = 1.0
    """Clutter relative to the building's."""


class _Floor:
    """The raster of a building's floor: what is taken, in cells of 5 cm."""

    def __init__(self, solids: Sequence[Solid]) -> None:
        corners = np.concatenate([s.polygon for s in solids])
        self.origin_m = corners.min(axis=0) - 2.0 * CELL_M
        cols, rows = np.ceil((corners.max(axis=0) - self.origin_m) / CELL_M).astype(int) + 3
        self.taken = np.zeros((rows, cols), dtype=np.uint8)
        for solid in solids:
            cv2.fillConvexPoly(self.taken, self.pixels(solid.polygon), 1)

    def pixels(self, points: Array) -> npt.NDArray[np.int32]:
        """(N, 2) pixels (col, row) that hold (N, 2) points in metres."""
        return np.asarray(np.floor((points - self.origin_m) / CELL_M), dtype=np.int32)


def furnish_rooms(
    areas: Sequence[RoomArea], solids: Sequence[Solid], doors: Array, config: FurnishConfig, seed: int
) -> list[Solid]:
    """Put furniture and clutter into rooms.

    Args:
        areas: The rooms.
        solids: Walls and whatever stands already; not empty.
        doors: (D, 3) x_m, y_m, width_m of every door.
        config: How full.
        seed: Of this building; a room's furniture depends on it and on the room's own seed only.

    Returns:
        The new solids. From every door of a room a way of ``passage_m`` is free to the room's point.

    Raises:
        ValueError: a room lies outside the building.
    """
    floor = _Floor(solids)
    placed: list[Solid] = []
    for area in areas:
        if area.kind == RoomKind.EMPTY:
            continue
        rng = np.random.default_rng([seed, area.seed])
        placed.extend(_furnish(floor, area, doors, config, rng))
    return placed


def _furnish(
    floor: _Floor, area: RoomArea, doors: Array, config: FurnishConfig, rng: np.random.Generator
) -> list[Solid]:
    low = floor.pixels(np.array([rect[:2] for rect in area.rects]).min(axis=0, keepdims=True))[0]
    high = floor.pixels(np.array([rect[2:] for rect in area.rects]).max(axis=0, keepdims=True))[0] + 1
    low = np.maximum(low, 0)
    if not (low < np.minimum(high, floor.taken.shape[::-1])).all():
        raise ValueError(f"room '{area.room.name}' lies outside the building")
    inside = np.zeros((high[1] - low[1], high[0] - low[0]), dtype=np.uint8)
    for rect in area.rects:
        (x0, y0), (x1, y1) = floor.pixels(np.reshape(rect, (2, 2))) - low
        inside[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1] = 1
    taken = floor.taken[low[1] : high[1], low[0] : high[0]]
    inside = inside[: taken.shape[0], : taken.shape[1]]
    origin_m = floor.origin_m + low * CELL_M
    usable = (inside > 0) & (taken == 0)
    usable &= ~_kept_free(usable, area, doors, origin_m, config)
    filler = Filler(usable, (inside > 0) & (taken > 0), origin_m, rng)
    area_m2 = float(np.count_nonzero(inside)) * CELL_M**2
    furnishing = FURNISHINGS[area.kind]
    if rng.random() < furnishing.bays:
        filler.put_bays()
    for recipe in furnishing.recipes:
        for _ in range(rng.poisson(recipe.per_10_m2 * config.furniture * area_m2 / 10.0)):
            filler.put(recipe.maker(rng), recipe.against_wall)
    for _ in range(rng.poisson(furnishing.clutter_per_10_m2 * config.clutter * area.clutter * area_m2 / 10.0)):
        filler.put(furniture.oddment(rng), bool(rng.random() < 0.5))
    return filler.solids


def _kept_free(usable: Mask, area: RoomArea, doors: Array, origin_m: Array, config: FurnishConfig) -> Mask:
    """(H, W) cells of the ways from the doors to the room's point, and of the middle of corridors."""
    clearance = cv2.distanceTransform(usable.astype(np.uint8), cv2.DIST_L2, 3) * CELL_M
    kept = np.zeros(usable.shape, dtype=np.uint8)
    half_px = round(config.passage_m / 2.0 / CELL_M)
    anchor = np.floor((np.array([area.room.x_m, area.room.y_m]) - origin_m) / CELL_M).astype(int)
    cv2.circle(kept, (int(anchor[0]), int(anchor[1])), half_px + 2, 1, -1)
    step = 2
    coarse = usable[::step, ::step]
    graph = grid_graph(coarse, 1.0 + 3.0 * np.exp(-3.0 * clearance[::step, ::step]))
    nodes = np.nonzero(coarse.ravel())[0]
    centers = np.stack([nodes % coarse.shape[1], nodes // coarse.shape[1]], axis=-1) * step
    if len(nodes) == 0:
        return kept > 0
    source = nodes[np.argmin(np.abs(centers - anchor).sum(axis=1))]
    _, before = search(graph, int(source))
    for x, y, width in doors:
        pixel = (np.array([x, y]) - origin_m) / CELL_M
        distances = np.hypot(*(centers - pixel).T)
        nearest = int(np.argmin(distances))
        if distances[nearest] * CELL_M > 0.5:
            continue
        cv2.circle(kept, (int(pixel[0]), int(pixel[1])), round((width / 2.0 + 0.3) / CELL_M), 1, -1)
        path = trace_path(before, int(nodes[nearest]))
        route = np.stack([path % coarse.shape[1], path // coarse.shape[1]], axis=-1) * step
        cv2.polylines(kept, [route.astype(np.int32)], False, 1, 2 * half_px)
    if area.kind == RoomKind.CORRIDOR:
        kept[clearance > (0.35 if clearance.max() < 1.1 else 0.55)] = 1
    return kept > 0
