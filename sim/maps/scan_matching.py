"""Scan-to-map matching that starts from odometry: search the likely poses, refine the best, add the scan, go on.

Sources: Olson, "Real-time correlative scan matching", ICRA 2009 (search on a coarse field that bounds the fine one);
Kohlbrecher et al., "A flexible and scalable SLAM system with full 3D motion estimation", SSRR 2011 (least squares on
an interpolated field; theirs, of 1 - value, is flat at a surface, since it grows with the distance's fourth power).
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt
from numba import njit

from merger import se2
from sim.maps.likelihood_field import BLOCK, draw_surfaces, search_pose
from sim.maps.pose_refinement import refine_pose

_GROWTH_CELLS = 32 * BLOCK
_MIN_POINTS = 10
"""A scan with fewer ends stays where odometry puts it."""
_SEARCH_POINTS = 100
"""At most so many ends are used to search; all of them to refine."""
_STEP_CELLS = 2.0
"""Headings are searched in steps that move the farther ends by so many cells."""


@dataclass(frozen=True)
class ScanMatchingConfig:
    """How scans are matched.

    Raises:
        ValueError: a value is out of its range.
    """

    resolution_m: float = 0.05
    """Side of a cell of the field, > 0."""
    sigma_m: float = 0.05
    """Width of the field around a surface, > 0."""
    search_sigmas: float = 3.0
    """Half the width of the search, in standard deviations of the odometry since the last scan, > 0."""
    point_weight: float = 1.0
    """Log-likelihood that a well fitting point is worth against the odometry, > 0; 1 is a Gaussian of ``sigma_m``."""
    insertion_m: float = 0.25
    """A scan is added to the map when the robot has moved this far since the last one that was, > 0 ..."""
    insertion_rad: float = 0.2
    """... or turned so far, > 0."""

    def __post_init__(self) -> None:
        """Refuse what cannot match."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"scan matching: {item.name} must be > 0, got {value:g}")


class ScanMatcher:
    """The surfaces seen so far, and where the lidar was last."""

    def __init__(self, config: ScanMatchingConfig, T_map_first: npt.NDArray[np.float64]) -> None:
        """Begin without surfaces, the lidar at its first pose."""
        self._config = config
        self._field = np.zeros((0, 0), dtype=np.float32)
        self._coarse = np.zeros((0, 0), dtype=np.float32)
        self._first_cell = np.zeros(2)
        self._pose = se2.parameters_of(T_map_first)
        self._inserted = np.full(3, np.nan)

    def add_scans(
        self,
        surfaces: tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]],
        T_before_after: npt.NDArray[np.float64],
        sigmas: npt.NDArray[np.float64],
    ) -> npt.NDArray[np.float64]:
        """Find the poses of scans one after the other, each against all that came before.

        Args:
            surfaces: (S, B, 4) ends and normals, (S, B) links: `sim.maps.scan_surfaces.find_surfaces`.
            T_before_after: (S, 3, 3) motion of the lidar by odometry since the scan before; the identity for the
                first scan.
            sigmas: (S, 2) its standard deviations, metres and radians.

        Returns:
            (S, 3, 3) estimated poses ``T_map_lidar``.
        """
        config = self._config
        settings = (
            config.resolution_m,
            config.sigma_m / config.resolution_m,
            config.search_sigmas,
            config.point_weight,
        )
        insertion = (config.insertion_m, config.insertion_rad)
        motions, out = se2.parameters_of(T_before_after), np.empty((len(sigmas), 3))
        done = 0
        while done < len(out):
            self._grow(surfaces[0][done], motions[done])
            state = (self._field, self._coarse, self._first_cell, self._pose, self._inserted)
            done = _match_scans(state, surfaces, (motions, sigmas), (settings, insertion), (out, done))
        return se2.make_motion(*out.T)

    def _grow(self, ends: npt.NDArray[np.float64], motion: npt.NDArray[np.float64]) -> None:
        """Enlarge the fields so that they surely hold the next scan."""
        lengths_m = np.hypot(ends[:, 0], ends[:, 1])
        reach_m = np.nanmax(lengths_m, initial=0.0) + 2.0 * math.hypot(motion[0], motion[1]) + 2.0
        center, reach = self._pose[:2] / self._config.resolution_m, reach_m / self._config.resolution_m
        rows, columns = self._field.shape
        first, end = self._first_cell, self._first_cell + np.array([columns, rows])
        low = np.floor((center - reach) / _GROWTH_CELLS) * _GROWTH_CELLS
        high = (np.floor((center + reach) / _GROWTH_CELLS) + 1.0) * _GROWTH_CELLS
        if self._field.size:
            low, high = np.minimum(low, first), np.maximum(high, end)
            if (low == first).all() and (high == end).all():
                return
        width, height = (int(n) for n in high - low)
        column, row = (int(n) for n in first - low) if self._field.size else (0, 0)
        self._field = _moved(self._field, (height, width), (row, column))
        self._coarse = _moved(self._coarse, (height // BLOCK, width // BLOCK), (row // BLOCK, column // BLOCK))
        self._first_cell = low


def _moved(field: npt.NDArray[np.float32], shape: tuple[int, int], place: tuple[int, int]) -> npt.NDArray[np.float32]:
    """A field of zeros of this shape with another one put into it."""
    grown = np.zeros(shape, dtype=np.float32)
    grown[place[0] : place[0] + field.shape[0], place[1] : place[1] + field.shape[1]] = field
    return grown


@njit(cache=True, nogil=True)
def _match_scans(state, surfaces, odometry, config, progress):  # type: ignore[no-untyped-def] # a kernel
    """Match scans until one may not fit into the field; the number of the first scan that was not matched."""
    field, coarse, first_cell, pose, inserted = state
    (motions, sigmas), (settings, insertion), (out, start) = odometry, config, progress
    for s in range(start, len(out)):
        if s > start and not _holds(field, (first_cell, settings[0]), pose, surfaces[0][s], motions[s]):
            return s
        _move(pose, motions[s])
        points, linked = _turned_points(surfaces[0][s], pose[2], settings[0]), surfaces[1][s]
        if inserted[0] == inserted[0]:
            _match((field, coarse, first_cell), points, pose, sigmas[s], settings)
            points = _turned_points(surfaces[0][s], pose[2], settings[0])
        moved_m = math.hypot(pose[0] - inserted[0], pose[1] - inserted[1])
        turned_rad = abs((pose[2] - inserted[2] + math.pi) % (2.0 * math.pi) - math.pi)
        if not (moved_m < insertion[0] and turned_rad < insertion[1]):
            for k in range(2):
                points[:, k] += pose[k] / settings[0] - first_cell[k]
            draw_surfaces(field, coarse, points, linked, settings[1])
            inserted[:] = pose
        out[s] = pose
    return len(out)


@njit(cache=True, nogil=True)
def _holds(field, frame, pose, ends, motion):  # type: ignore[no-untyped-def] # a kernel
    """Whether the field surely holds the next scan."""
    first_cell, cell_m = frame
    reach_m = 0.0
    for b in range(len(ends)):
        if ends[b, 0] == ends[b, 0]:
            reach_m = max(reach_m, math.hypot(ends[b, 0], ends[b, 1]))
    reach = (reach_m + 2.0 * math.hypot(motion[0], motion[1]) + 1.0) / cell_m
    x, y = pose[0] / cell_m - first_cell[0], pose[1] / cell_m - first_cell[1]
    return x - reach >= 0.0 and y - reach >= 0.0 and x + reach < field.shape[1] and y + reach < field.shape[0]


@njit(cache=True, nogil=True)
def _move(pose, motion):  # type: ignore[no-untyped-def] # a kernel
    """Add a motion of its own frame to a pose x, y, theta, in place."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    pose[0] += cosine * motion[0] - sine * motion[1]
    pose[1] += sine * motion[0] + cosine * motion[1]
    pose[2] += motion[2]


@njit(cache=True, nogil=True)
def _turned_points(ends, theta, cell_m):  # type: ignore[no-untyped-def] # a kernel
    """(B, 2) ends in cells, turned into frame ``map``, relative to the lidar; NaN where there is none."""
    points = np.empty((len(ends), 2))
    cosine, sine = math.cos(theta) / cell_m, math.sin(theta) / cell_m
    for b in range(len(ends)):
        points[b, 0] = cosine * ends[b, 0] - sine * ends[b, 1]
        points[b, 1] = sine * ends[b, 0] + cosine * ends[b, 1]
    return points


@njit(cache=True, nogil=True)
def _match(fields, points, pose, sigmas, settings):  # type: ignore[no-untyped-def] # a kernel
    """Move a predicted pose, in place, to where the scan fits the field best, the odometry considered."""
    field, coarse, first_cell = fields
    cell_m, sigma, search_sigmas, weight = settings
    usable = points[~np.isnan(points[:, 0])]
    if len(usable) < _MIN_POINTS:
        return
    thin = usable[:: math.ceil(len(usable) / _SEARCH_POINTS)].copy()
    farther = max(np.quantile(np.sqrt(thin[:, 0] ** 2 + thin[:, 1] ** 2), 0.8), 20.0)
    x, y = pose[0] / cell_m - first_cell[0], pose[1] / cell_m - first_cell[1]
    prior = (weight, (cell_m / sigmas[0]) ** 2, 1.0 / sigmas[1] ** 2)
    window = (x, y, search_sigmas * sigmas[0] / cell_m, search_sigmas * sigmas[1], _STEP_CELLS / farther)
    scaled = (weight * len(usable) / len(thin), prior[1], prior[2])
    shift_x, shift_y, turn, _ = search_pose(field, coarse, thin, window, scaled)
    shift_x, shift_y, turn = refine_pose(field, usable, (x, y, shift_x, shift_y, turn), prior, sigma)
    pose[0] += shift_x * cell_m
    pose[1] += shift_y * cell_m
    pose[2] += turn
