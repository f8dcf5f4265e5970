"""Follow a path with a differential drive: pure pursuit, slower where it is narrow, turning on the spot at corners.

Source: R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992.
"""

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_LOOKAHEAD_M = 0.45
_SEARCH_AHEAD = 12
"""Points ahead among which the nearest is sought; the path may cross itself farther on."""
_TURN_ON_SPOT_RAD = 0.9
_TURN_GAIN = 2.5
_ARRIVED_M = 0.15
CREEP_MPS = 0.12
"""Speed that is always allowed."""
_BRAKING_MPS2 = 0.5


class PathFollower:
    """A path, and how far along it a robot is."""

    def __init__(self, path: Array) -> None:
        """Follow (M, 2) points about 0.1 m apart, M >= 1, in metres."""
        self._points: list[tuple[float, float]] = [(float(x), float(y)) for x, y in path]
        self._index = 0

    def extend(self, path: Array) -> None:
        """Go on along (M, 2) further points."""
        self._points = self._points[max(self._index - 1, 0) :]
        self._index = min(self._index, 1)
        self._points.extend((float(x), float(y)) for x, y in path)

    @property
    def num_points_left(self) -> int:
        """Points not yet passed."""
        return len(self._points) - self._index

    def ahead(self, num_points: int) -> list[tuple[float, float]]:
        """At most so many of the next points, in metres."""
        return self._points[self._index : self._index + num_points]

    def arrived(self, x_m: float, y_m: float) -> bool:
        """Whether a robot there is at the path's end."""
        end = self._points[-1]
        return self.num_points_left <= 3 and math.hypot(end[0] - x_m, end[1] - y_m) < _ARRIVED_M

    def steer(self, pose: tuple[float, float, float], spare_m: float, max_speed_mps: float) -> tuple[float, float]:
        """Speeds to ask the wheels for.

        Args:
            pose: x_m, y_m, theta_rad of the robot.
            spare_m: Clearance of the robot's body.
            max_speed_mps: Its top speed.

        Returns:
            Forward speed in m/s and turning speed in rad/s.
        """
        x, y, theta = pose
        self._advance(x, y)
        target_x, target_y = self._target(x, y)
        away = math.hypot(target_x - x, target_y - y)
        if away < 1e-6:
            return 0.0, 0.0
        error = math.remainder(math.atan2(target_y - y, target_x - x) - theta, 2.0 * math.pi)
        if abs(error) > _TURN_ON_SPOT_RAD:
            return 0.0, _TURN_GAIN * error
        left_m = 0.1 * (self.num_points_left - 1) + away if self.num_points_left < 10 else 10.0
        limit = min(max_speed_mps, CREEP_MPS + 1.5 * max(spare_m, 0.0), math.sqrt(2.0 * _BRAKING_MPS2 * left_m))
        speed = max(limit * math.cos(error) ** 2, CREEP_MPS)
        return speed, 2.0 * speed * math.sin(error) / max(away, 0.2)

    def _advance(self, x: float, y: float) -> None:
        """Move on to the nearest of the next points."""
        points, index = self._points, self._index
        best, nearest = math.inf, index
        for k in range(index, min(index + _SEARCH_AHEAD, len(points))):
            px, py = points[k]
            squared = (px - x) * (px - x) + (py - y) * (py - y)
            if squared < best - 1e-12:
                best, nearest = squared, k
        self._index = nearest

    def _target(self, x: float, y: float) -> tuple[float, float]:
        """The first point farther away than the lookahead, or the last."""
        for k in range(self._index, len(self._points)):
            px, py = self._points[k]
            if (px - x) * (px - x) + (py - y) * (py - y) > _LOOKAHEAD_M * _LOOKAHEAD_M:
                return px, py
        return self._points[-1]
