"""What wheels tell: the motion model of Thrun, Burgard and Fox, integrated beside the true trajectory.

Source: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, Table 5.6 (``sample_motion_model_odometry``).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2

Array = npt.NDArray[np.float64]

_LARGEST_ALPHA, _LONGEST_M = 10.0, 10.0
_STANDSTILL_M = 1e-6
"""Below it a motion has no direction: it is a turn on the spot."""


@dataclass(frozen=True)
class OdometryConfig:
    """How wheels err. All zero, and wheel scales of one, is perfect odometry."""

    alpha1: float = 0.1
    """Variance of turning by turning (rad2 per rad2), 0 to 10."""
    alpha2: float = 0.05
    """Variance of turning by driving (rad2 per m2), 0 to 10."""
    alpha3: float = 0.1
    """Variance of driving by driving (m2 per m2), 0 to 10."""
    alpha4: float = 0.05
    """Variance of driving by turning (m2 per rad2), 0 to 10."""
    step_m: float = 0.025
    """The model is taken for motions of this many metres (or radians), in (0, 10], as by wheels that are read about 25
    times a second; longer and shorter ones get the variance that such steps add up to, so that drift does not depend on
    how often a lidar scans."""
    left_wheel_scale: float = 1.0
    """Metres told for a metre of the left wheel, in [0.5, 2]."""
    right_wheel_scale: float = 1.0
    """Metres told for a metre of the right wheel, in [0.5, 2]."""
    wheel_base_m: float = 0.4
    """Distance between the wheels, in (0, 10]."""

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        for name in ("alpha1", "alpha2", "alpha3", "alpha4"):
            if not 0.0 <= getattr(self, name) <= _LARGEST_ALPHA:
                raise ValueError(f"{name} must be in [0, {_LARGEST_ALPHA:g}], got {getattr(self, name)}")
        for name in ("step_m", "wheel_base_m"):
            if not 0.0 < getattr(self, name) <= _LONGEST_M:
                raise ValueError(f"{name} must be in (0, {_LONGEST_M:g}] m, got {getattr(self, name)}")
        for name in ("left_wheel_scale", "right_wheel_scale"):
            if not 0.5 <= getattr(self, name) <= 2.0:
                raise ValueError(f"{name} must be in [0.5, 2], got {getattr(self, name)}")


def integrate_odometry(T_world_robot: Array, config: OdometryConfig, rng: np.random.Generator) -> Array:
    """Let odometry follow a true trajectory.

    Args:
        T_world_robot: (N, 3, 3) true poses, N >= 1.
        config: How wheels err.
        rng: Of this robot's odometry.

    Returns:
        (N, 3, 3) poses ``T_odom_robot``; the first is the identity.
    """
    T_before_after = se2.invert(T_world_robot[:-1]) @ T_world_robot[1:]
    told = _with_noise(_with_wheel_scales(T_before_after, config), config, rng)
    steps = se2.parameters_of(told)
    angles = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    cosine, sine = np.cos(angles[:-1]), np.sin(angles[:-1])
    x = np.concatenate([[0.0], np.cumsum(cosine * steps[:, 0] - sine * steps[:, 1])])
    y = np.concatenate([[0.0], np.cumsum(sine * steps[:, 0] + cosine * steps[:, 1])])
    return se2.make_motion(x, y, angles)


def _with_wheel_scales(T_before_after: Array, config: OdometryConfig) -> Array:
    """Motions as told by wheels of a wrong size."""
    if config.left_wheel_scale == 1.0 and config.right_wheel_scale == 1.0:
        return T_before_after
    twist = se2.log(T_before_after)
    half_base = 0.5 * config.wheel_base_m
    left = (twist[:, 0] - half_base * twist[:, 2]) * config.left_wheel_scale
    right = (twist[:, 0] + half_base * twist[:, 2]) * config.right_wheel_scale
    told = np.stack([(left + right) / 2.0, twist[:, 1], (right - left) / config.wheel_base_m], axis=-1)
    return se2.exp(told)


def _with_noise(T_before_after: Array, config: OdometryConfig, rng: np.random.Generator) -> Array:
    """Turn, drive, turn, each with its error (Table 5.6); driving backwards is no half turn."""
    dx, dy, turn = se2.parameters_of(T_before_after).T
    drive = np.hypot(dx, dy)
    forward = np.where(dx < 0.0, -1.0, 1.0)
    turn_1 = np.where(drive > _STANDSTILL_M, np.arctan2(forward * dy, forward * dx), 0.0)
    turn_2 = se2.wrap_angle(turn - turn_1)
    sq_1, sq_2, sq_drive = (np.abs(v) * config.step_m for v in (turn_1, turn_2, drive))
    noise = rng.standard_normal((3, len(turn)))
    turn_1 = turn_1 + noise[0] * np.sqrt(config.alpha1 * sq_1 + config.alpha2 * sq_drive)
    told = drive + noise[1] * np.sqrt(config.alpha3 * sq_drive + config.alpha4 * (sq_1 + sq_2))
    turn_2 = turn_2 + noise[2] * np.sqrt(config.alpha1 * sq_2 + config.alpha2 * sq_drive)
    told = told * forward
    return se2.make_motion(told * np.cos(turn_1), told * np.sin(turn_1), turn_1 + turn_2)
