"""What a building is made of, before anything scans it: solid pieces, and the places that matter to a robot.

World files, the office generator and traced maps all give a `Plan`; `sim.buildings.world` turns it into what a lidar
sees.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Material(IntEnum):
    """What a surface is made of; lidar effects differ by it."""

    WALL = 0
    GLASS = 1
    FURNITURE = 2
    CLUTTER = 3
    DOOR = 4


@dataclass(frozen=True)
class Solid:
    """A convex piece of building that no robot enters."""

    polygon: Array
    """(P, 2) corners in metres, frame ``world``, counter-clockwise, P >= 3."""
    material: Material
    """What its surface is made of."""


@dataclass(frozen=True)
class Room:
    """A place that every robot can reach; coverage visits it."""

    name: str
    """For messages."""
    x_m: float
    """A point on the room's free floor, frame ``world``."""
    y_m: float
    """A point on the room's free floor, frame ``world``."""


@dataclass(frozen=True)
class Plan:
    """A building: its pieces, rooms, and where robots start."""

    name: str
    """The world's name."""
    solids: tuple[Solid, ...]
    """Convex pieces; they may overlap."""
    rooms: tuple[Room, ...]
    """Rooms to be visited; may be empty."""
    starts: Array
    """(K, 3) free places x_m, y_m, theta_rad, frame ``world``, in the order in which robots take them."""
    waypoints: tuple[Array, ...] = ()
    """One (M, 2) route in metres for each robot, or none: then robots plan by themselves."""
    outlines: Array | None = None
    """(N, 2, 2) further wall segments in metres that are already outlines (traced maps)."""


def box(x_m: float, y_m: float, size_m: tuple[float, float], angle_rad: float = 0.0) -> Array:
    """(4, 2) corners of a box by its centre, its (width, depth) in metres, and its angle."""
    half_w, half_d = size_m[0] / 2.0, size_m[1] / 2.0
    corners = np.array([[-half_w, -half_d], [half_w, -half_d], [half_w, half_d], [-half_w, half_d]])
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(corners @ np.array([[cosine, sine], [-sine, cosine]]) + (x_m, y_m))


def disc(x_m: float, y_m: float, radius_m: float, num_corners: int = 12) -> Array:
    """(num_corners, 2) corners of a round thing."""
    angles = (np.arange(num_corners) + 0.5) * (2.0 * math.pi / num_corners)
    return np.stack([x_m + radius_m * np.cos(angles), y_m + radius_m * np.sin(angles)], axis=-1)


def strip(start: Array, end: Array, thickness_m: float) -> Array:
    """(4, 2) corners of a wall by the (2,) ends of its centre line and its thickness in metres."""
    along = end - start
    across = np.array([-along[1], along[0]]) * (0.5 * thickness_m / float(np.hypot(*along)))
    return np.stack([start - across, end - across, end + across, start + across])
