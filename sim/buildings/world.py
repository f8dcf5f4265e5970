"""The building as robots and lidars meet it: surfaces in metres, rooms, and starts."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sim.buildings.floor_plan import OfficeConfig, draw_office
from sim.buildings.furnishing import FurnishConfig
from sim.buildings.outlines import outline_segments
from sim.buildings.plan import Material, Plan, Room
from sim.buildings.traced_world import trace_map
from sim.buildings.world_check import check_plan
from sim.buildings.world_file import is_map_file, read_world_file
from sim.resources import worlds_folder

__all__ = ["OFFICE", "Material", "Room", "World", "make_world", "read_world"]

Array = npt.NDArray[np.float64]

OFFICE = "office"
"""The name of generated buildings."""
SHORTEST_SEGMENT_M = 1e-6
"""A shorter segment is degenerate."""


@dataclass(frozen=True)
class World:
    """A building in frame ``world``.

    Raises:
        ValueError: a shape is wrong, a number is not finite, or a segment is degenerate.
    """

    name: str
    """For messages and datasets."""
    segments: Array
    """(N, 2, 2) surfaces: both ends of each segment in metres. A wall has two faces."""
    materials: npt.NDArray[np.int8]
    """(N,) `Material` of each segment."""
    starts: Array
    """(K, 3) free places x_m, y_m, theta_rad, in the order in which robots take them."""
    rooms: tuple[Room, ...] = ()
    """Rooms, each with a point that robots can reach."""
    waypoints: tuple[Array, ...] = ()
    """One (M, 2) route in metres for each robot, or none: then robots plan by themselves."""

    def __post_init__(self) -> None:
        """Refuse what is no world."""
        if self.segments.ndim != 3 or self.segments.shape[1:] != (2, 2) or len(self.segments) == 0:
            raise ValueError(f"world '{self.name}': segments must be (N, 2, 2), N > 0, got {self.segments.shape}")
        if self.materials.shape != self.segments.shape[:1]:
            raise ValueError(f"world '{self.name}': {len(self.segments)} segments, materials {self.materials.shape}")
        if self.starts.ndim != 2 or self.starts.shape[1] != 3:
            raise ValueError(f"world '{self.name}': starts must be (K, 3), got {self.starts.shape}")
        if not (np.isfinite(self.segments).all() and np.isfinite(self.starts).all()):
            raise ValueError(f"world '{self.name}': coordinates must be finite")
        short = np.hypot(*(self.segments[:, 1] - self.segments[:, 0]).T) < SHORTEST_SEGMENT_M
        if short.any():
            x, y = self.segments[np.argmax(short), 0]
            raise ValueError(f"world '{self.name}': a segment at ({x:.3f}, {y:.3f}) has no length")

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """Smallest x, smallest y, largest x, largest y of all surfaces, metres."""
        low, high = self.segments.min(axis=(0, 1)), self.segments.max(axis=(0, 1))
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def read_world(
    name_or_path: str, *, office: OfficeConfig | None = None, furnish: FurnishConfig | None = None, seed: int = 0
) -> World:
    """Read, trace or draw a building, and check it.

    Args:
        name_or_path: A world file's name in ``worlds/`` (``tim``, ``intel``, ``fr079``), ``office`` for a generated
            building, or the path of a world file or of a `map_server` map's YAML.
        office: What a generated building must be like.
        furnish: How full rooms are that are furnished by a seed (world files, generated buildings).
        seed: Of a generated building.

    Raises:
        ValueError: there is no such world, the file cannot be used, or robots cannot work in the building.
    """
    furnish = furnish or FurnishConfig()
    if name_or_path == OFFICE:
        return make_world(draw_office(office or OfficeConfig(), furnish, seed))
    path = Path(name_or_path)
    if path.suffix:
        return _world_of_file(path, trace_map(path) if is_map_file(path) else read_world_file(path, furnish))
    bundled = worlds_folder() / f"{name_or_path}.yaml"
    if not bundled.is_file():
        known = [*sorted(p.stem for p in worlds_folder().glob("*.yaml")), OFFICE]
        raise ValueError(f"world '{name_or_path}' is unknown: give one of {', '.join(known)}, or a YAML file's path")
    return _world_of_file(bundled, read_world_file(bundled, furnish))


def make_world(plan: Plan) -> World:
    """Turn a plan into the surfaces that a lidar sees, and check it.

    Raises:
        ValueError: the plan has no surfaces, the outline is open, a start is inside a wall, or a room cannot be
            reached.
    """
    segments, materials = outline_segments(plan.solids)
    if plan.outlines is not None:
        segments = np.concatenate([segments, plan.outlines])
        walls = np.full(len(plan.outlines), Material.WALL, dtype=np.int8)
        materials = np.concatenate([materials, walls])
    world = World(plan.name, segments, materials, plan.starts, plan.rooms, plan.waypoints)
    check_plan(plan, segments)
    return world


def _world_of_file(path: Path, plan: Plan) -> World:
    try:
        return make_world(plan)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
