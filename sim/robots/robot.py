"""A differential-drive robot: a disc in a pymunk space that wheels push, within their limits, and that walls stop."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pymunk

Array = npt.NDArray[np.float64]

_MASS_KG = 10.0
_SKIN_M = 0.02
"""The body is so much larger than the robot that a contact, which may sink in by a fraction of it, is no overlap."""
_SLOP_M = 0.001


@dataclass(frozen=True)
class RobotConfig:
    """A robot's size and what its wheels can do."""

    radius_m: float = 0.25
    """Radius of its body, in [0.05, 2]."""
    max_speed_mps: float = 0.7
    """Forward speed, in (0, 3]."""
    max_turn_radps: float = 1.5
    """Turning speed, in (0, 10]."""
    acceleration_mps2: float = 0.8
    """Change of forward speed, > 0."""
    turn_acceleration_radps2: float = 4.0
    """Change of turning speed, > 0."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        limits = {"radius_m": (0.05, 2.0), "max_speed_mps": (0.01, 3.0), "max_turn_radps": (0.01, 10.0)}
        limits |= {"acceleration_mps2": (0.01, 100.0), "turn_acceleration_radps2": (0.01, 100.0)}
        for name, (low, high) in limits.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {getattr(self, name)}")


def make_space(segments: Array) -> pymunk.Space:
    """A space without gravity whose (N, 2, 2) walls, in metres, never move."""
    space = pymunk.Space()
    space.collision_slop = _SLOP_M
    space.collision_bias = 1e-4
    walls = [pymunk.Segment(space.static_body, tuple(a), tuple(b), 0.0) for a, b in segments.tolist()]
    space.add(*walls)
    return space


class Robot:
    """The body of one robot and the speed of its wheels."""

    def __init__(self, space: pymunk.Space, pose: Array, config: RobotConfig) -> None:
        """Stand at a (3,) pose x_m, y_m, theta_rad."""
        self.config = config
        radius_m = config.radius_m + _SKIN_M
        self._moment = pymunk.moment_for_circle(_MASS_KG, 0.0, radius_m)
        self.body = pymunk.Body(_MASS_KG, self._moment)
        self.body.position = float(pose[0]), float(pose[1])
        self.body.angle = float(pose[2])
        self._shape = pymunk.Circle(self.body, radius_m)
        self._shape.friction = 0.2
        space.add(self.body, self._shape)
        self.speed_mps, self.turn_radps = 0.0, 0.0
        self.pose = (0.0, 0.0, 0.0)
        """x_m, y_m, theta_rad (not wrapped) after the last step."""
        self.sense()

    def sense(self) -> None:
        """Take note of where the space's last step has put the body."""
        x, y = self.body.position
        self.pose = x, y, self.body.angle

    def drive(self, speed_mps: float, turn_radps: float, step_s: float) -> None:
        """Ask the wheels for a speed; they approach it as fast as they can, and push the body for the next step.

        The push is a force, not a velocity, so that the solver can hold it up against a wall.
        """
        limits = self.config
        most = limits.acceleration_mps2 * step_s
        self.speed_mps += min(max(speed_mps - self.speed_mps, -most), most)
        most = limits.turn_acceleration_radps2 * step_s
        self.turn_radps += min(max(turn_radps - self.turn_radps, -most), most)
        body = self.body
        angle = self.pose[2]
        vx, vy = body.velocity
        push = _MASS_KG / step_s
        body.force = (
            push * (self.speed_mps * math.cos(angle) - vx),
            push * (self.speed_mps * math.sin(angle) - vy),
        )
        body.torque = self._moment / step_s * (self.turn_radps - body.angular_velocity)

    def leave(self, space: pymunk.Space) -> None:
        """Be carried out of the building."""
        space.remove(self.body, self._shape)
