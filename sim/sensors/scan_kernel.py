"""The kernel that casts whole scans: geometry first, beam by beam, then what goes wrong with each return."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from sim.sensors.counter_random import normal_at, stream_key, uniform_at
from sim.sensors.lidar_noise import NoiseConfig
from sim.sensors.ray_casting import Discs, measure_incidence, meet_discs, meet_walls
from sim.sensors.segment_grid import SegmentGrid

_SCAN_SHIFT = np.uint64(20)
"""A beam's counter is scan << 20 | beam."""
_EDGE_M = 0.3
"""A difference of two neighbouring ranges above it is an edge."""
_GLASS_MIRROR_COS = math.cos(math.radians(8.0))
"""Nearer to the normal than this, glass throws the beam back."""
_STEPS_PER_M = 1000.0
"""Ranges are multiples of 1 mm, as real sensors give them."""


class Effects(NamedTuple):
    """`NoiseConfig` as the kernel takes it."""

    range_sigma_m: float
    range_sigma_ratio: float
    angle_sigma_rad: float
    dropout: float
    max_range_miss: float
    mixed_pixel: float
    glass: float
    incidence_loss: float


class EffectKeys(NamedTuple):
    """The stream of each effect."""

    range_m: np.uint64
    range_ratio: np.uint64
    angle: np.uint64
    dropout: np.uint64
    max_range_miss: np.uint64
    mixed_pixel: np.uint64
    mixed_weight: np.uint64
    glass: np.uint64
    incidence_loss: np.uint64


class Scanner(NamedTuple):
    """A lidar as the kernel takes it."""

    directions: npt.NDArray[np.float64]
    """(B, 2) unit vectors of the beams in frame ``lidar``."""
    range_min_m: float
    range_max_m: float
    time_increment_s: float
    """Time between beams; 0 without skew."""


class Surroundings(NamedTuple):
    """What beams can meet."""

    grid: SegmentGrid
    """All walls."""
    glass: npt.NDArray[np.bool_]
    """(N,) which of them are of glass."""
    behind_glass: SegmentGrid
    """The others, which is what a beam meets that glass lets through."""
    discs: Discs
    """Moving obstacles: one row a scan of the chunk, or one for all."""


def effects_of(noise: NoiseConfig) -> Effects:
    """The settings of the effects."""
    return Effects(*(float(getattr(noise, name)) for name in Effects._fields))


def effect_keys(seed: int, robot: str) -> EffectKeys:
    """One stream for each effect of one robot's lidar."""
    return EffectKeys(*(stream_key(seed, robot, name) for name in EffectKeys._fields))


def cast_scans(
    surroundings: Surroundings,
    scanner: Scanner,
    motion: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], int],
    effects: Effects,
    keys: EffectKeys,
) -> npt.NDArray[np.float32]:
    """Cast scans.

    Args:
        surroundings: Walls and obstacles.
        scanner: The lidar.
        motion: (S, 3) poses x, y, theta of the lidar at the scans' stamps, frame ``world``; (S, 3) their rates,
            m/s and rad/s; the number of the first scan in its run.
        effects: What goes wrong.
        keys: The streams.

    Returns:
        (S, B) ranges in metres, by REP 117.
    """
    poses, rates, first = motion
    out = np.empty((len(poses), len(scanner.directions)), dtype=np.float32)
    _cast(surroundings, scanner, (poses, rates, np.uint64(first)), (effects, keys), out)
    return out


@njit(cache=True, nogil=True)
def _cast(surroundings, scanner, motion, noise, out):  # type: ignore[no-untyped-def] # a kernel
    poses, rates, first = motion
    effects, num_beams, some_glass = noise[0], len(scanner.directions), surroundings.glass.any()
    rays, walls = np.empty((num_beams, 4)), np.empty(num_beams, dtype=np.int64)
    true_m, cosines = np.empty(num_beams), np.empty(num_beams)
    for s in range(len(poses)):
        counter = (first + np.uint64(s)) << _SCAN_SHIFT
        _aim(scanner, (poses[s], rates[s], counter), noise, rays)
        meet_walls(surroundings.grid, rays, true_m, walls)
        if effects.incidence_loss > 0.0 or effects.glass > 0.0:
            measure_incidence(surroundings.grid.segments, rays, walls, cosines)
        if some_glass and effects.glass > 0.0:
            _pass_glass(surroundings, (rays, counter), noise, (true_m, walls, cosines))
        row = min(s, len(surroundings.discs.centers_m) - 1)
        centers_m, radii_m = surroundings.discs.centers_m[row : row + 1], surroundings.discs.radii_m
        meet_discs((centers_m, radii_m), rays, (true_m, walls, cosines))
        for b in range(num_beams):
            true_m[b] = true_m[b] * scanner.range_max_m if true_m[b] <= 1.0 else np.inf
        _disturb(scanner, (true_m, cosines), counter, noise, out[s])


@njit(cache=True, nogil=True)
def _aim(scanner, scan, noise, rays):  # type: ignore[no-untyped-def] # a kernel
    """The rays of a scan: where each beam starts and how it goes to the largest range."""
    pose, rate, counter = scan
    effects, keys = noise
    heading_x, heading_y = math.cos(pose[2]), math.sin(pose[2])
    turn_x, turn_y = math.cos(rate[2] * scanner.time_increment_s), math.sin(rate[2] * scanner.time_increment_s)
    for b in range(len(rays)):
        ahead_x, ahead_y = scanner.directions[b, 0], scanner.directions[b, 1]
        if effects.angle_sigma_rad > 0.0:
            off = effects.angle_sigma_rad * normal_at(keys.angle, counter | np.uint64(b))
            ahead_x, ahead_y = _turn_slightly(ahead_x, ahead_y, off)
        passed_s = b * scanner.time_increment_s
        rays[b, 0], rays[b, 1] = pose[0] + passed_s * rate[0], pose[1] + passed_s * rate[1]
        rays[b, 2] = scanner.range_max_m * (heading_x * ahead_x - heading_y * ahead_y)
        rays[b, 3] = scanner.range_max_m * (heading_y * ahead_x + heading_x * ahead_y)
        heading_x, heading_y = heading_x * turn_x - heading_y * turn_y, heading_y * turn_x + heading_x * turn_y


@njit(cache=True, nogil=True)
def _turn_slightly(x, y, angle):  # type: ignore[no-untyped-def] # a kernel
    """Turn a vector by a small angle (series to the fifth order)."""
    square = angle * angle
    cosine, sine = 1.0 - square / 2.0 * (1.0 - square / 12.0), angle * (1.0 - square / 6.0 * (1.0 - square / 20.0))
    return x * cosine - y * sine, x * sine + y * cosine


@njit(cache=True, nogil=True)
def _pass_glass(surroundings, beams, noise, found):  # type: ignore[no-untyped-def] # a kernel
    """Let beams that glass does not throw back go on to what is behind it."""
    rays, counter = beams
    effects, keys = noise
    fractions, walls, cosines = found
    passed = np.zeros(len(rays), dtype=np.bool_)
    for b in range(len(rays)):
        if walls[b] >= 0 and surroundings.glass[walls[b]] and cosines[b] <= _GLASS_MIRROR_COS:
            passed[b] = uniform_at(keys.glass, counter | np.uint64(b)) < effects.glass
    through = np.flatnonzero(passed)
    rays, behind = rays[through], np.empty(len(through), dtype=np.int64)
    farther, steeper = np.empty(len(through)), np.empty(len(through))
    meet_walls(surroundings.behind_glass, rays, farther, behind)
    measure_incidence(surroundings.behind_glass.segments, rays, behind, steeper)
    fractions[through], cosines[through] = farther, steeper


@njit(cache=True, nogil=True)
def _disturb(scanner, found, counter, noise, out):  # type: ignore[no-untyped-def] # a kernel
    """The ranges that the beams of a scan read."""
    effects, keys = noise
    true_m, cosines = found
    for b in range(len(out)):
        place, range_m = counter | np.uint64(b), true_m[b]
        if range_m == np.inf or _is_lost(range_m / scanner.range_max_m, cosines[b], place, noise):
            out[b] = np.inf
            continue
        if effects.dropout > 0.0 and uniform_at(keys.dropout, place) < effects.dropout:
            out[b] = np.nan
            continue
        if effects.mixed_pixel > 0.0:
            range_m += _mix_surfaces(true_m, b, place, noise)
        if effects.range_sigma_m > 0.0:
            range_m += effects.range_sigma_m * normal_at(keys.range_m, place)
        if effects.range_sigma_ratio > 0.0:
            range_m += effects.range_sigma_ratio * true_m[b] * normal_at(keys.range_ratio, place)
        range_m = math.floor(range_m * _STEPS_PER_M + 0.5) / _STEPS_PER_M
        too_near, too_far = range_m < scanner.range_min_m, range_m > scanner.range_max_m
        out[b] = -np.inf if too_near else (np.inf if too_far else range_m)


@njit(cache=True, nogil=True)
def _is_lost(share, cosine, place, noise):  # type: ignore[no-untyped-def] # a kernel
    """Whether a return from this share of the largest range is too weak: grazing, or too far away."""
    effects, keys = noise
    if effects.incidence_loss > 0.0:
        grazing = (1.0 - cosine) * (1.0 - cosine)
        if uniform_at(keys.incidence_loss, place) < effects.incidence_loss * grazing * grazing:
            return True
    return (
        effects.max_range_miss > 0.0 and uniform_at(keys.max_range_miss, place) < effects.max_range_miss * share * share
    )


@njit(cache=True, nogil=True)
def _mix_surfaces(true_m, b, place, noise):  # type: ignore[no-untyped-def] # a kernel
    """Metres that a beam beside an edge reads beyond, or short of, its own surface."""
    effects, keys = noise
    chance = uniform_at(keys.mixed_pixel, place)
    if chance >= effects.mixed_pixel:
        return 0.0
    neighbour = b + 1 if 2.0 * chance < effects.mixed_pixel else b - 1
    if neighbour < 0 or neighbour >= len(true_m) or true_m[neighbour] == np.inf:
        return 0.0
    gap_m = true_m[neighbour] - true_m[b]
    return uniform_at(keys.mixed_weight, place) * gap_m if abs(gap_m) > _EDGE_M else 0.0
