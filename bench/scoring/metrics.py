"""Is a map where it belongs? Placement scored against truth, exactly as the project's contract defines *wrong*.

Each function's docstring is the definition of its score: formula, range, unit, and what an empty case gives.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bench.scoring.prediction import Prediction
from merger import se2

Array = npt.NDArray[np.float64]

WRONG_ABOVE_M = 0.5
"""A placed map that is off by more, metres, is wrong."""
WRONG_ABOVE_DEG = 2.0
"""A placed map that is off by more, degrees, is wrong."""

_LEVER_M = WRONG_ABOVE_M / np.deg2rad(WRONG_ABOVE_DEG)
"""Arm at which an angle weighs as much as a shift, so that both bounds count alike in the fitted frame."""
_REFITS = 5


@dataclass(frozen=True)
class PlacementErrors:
    """Errors of N maps against truth, each in the frame that fits most of its component."""

    error_m: Array
    """(N,) distance between estimated and true origin of the map; NaN where it has none."""
    error_deg: Array
    """(N,) absolute angle between them, 0 to 180; NaN where it has none."""
    wrong: npt.NDArray[np.bool_]
    """(N,) placed in a component of two or more, and beyond 0.5 m or 2 degrees."""
    T_world_ref: Array
    """(N, 3, 3) the fitted frame of each map's component; NaN where it has none."""


@dataclass(frozen=True)
class Placement:
    """The contract's scores of one result."""

    num_maps: int
    """Maps given."""
    num_placed: int
    """Maps that the method says it placed."""
    num_wrong: int
    """Placed maps that are wrong."""
    num_components: int
    """Components of two or more placed maps."""
    success: bool
    """Every map is placed in one component and none is wrong."""
    max_error_m: float
    """Largest error of a placed map, metres; NaN without one."""
    max_error_deg: float
    """Largest error of a placed map, degrees; NaN without one."""
    median_error_m: float
    """Median over placed maps, metres; NaN without one."""
    median_error_deg: float
    """Median over placed maps, degrees; NaN without one."""


def placement_errors(
    T_world_map: Array, placed: npt.NDArray[np.bool_], component: npt.NDArray[np.int64], T_ref_map: Array
) -> PlacementErrors:
    """Errors of every placed map that has company.

    For each component of two or more placed maps, `fit_frame` gives ``T_world_ref``. With
    ``E = inv(T_world_map) @ T_world_ref @ T_ref_map`` a map's error is the length of E's translation in metres
    (0 to infinity) and the absolute value of its angle in degrees (0 to 180). A map is wrong beyond 0.5 m or 2
    degrees. A map that is not placed, or is alone, has NaN errors and is not wrong.

    Args:
        T_world_map: (N, 3, 3) true poses of the maps.
        placed: (N,) which maps are placed.
        component: (N,) number of each map's component.
        T_ref_map: (N, 3, 3) estimated motions into the frame of the component's reference.
    """
    count = len(T_world_map)
    error_m, error_deg = np.full(count, np.nan), np.full(count, np.nan)
    frames, wrong = np.full((count, 3, 3), np.nan), np.zeros(count, dtype=bool)
    for number in np.unique(component[placed]):
        members = np.flatnonzero(placed & (component == number))
        if len(members) < 2:
            continue
        frame = fit_frame(T_world_map[members], T_ref_map[members])
        error_m[members], error_deg[members] = motion_errors(T_world_map[members], frame @ T_ref_map[members])
        frames[members] = frame
        within = (error_m[members] <= WRONG_ABOVE_M) & (error_deg[members] <= WRONG_ABOVE_DEG)
        wrong[members] = ~within  # also where a motion is too large for its error to be a number
    return PlacementErrors(error_m, error_deg, wrong, frames)


def score_placement(prediction: Prediction, errors: PlacementErrors) -> Placement:
    """Count placed and wrong maps and sum up their errors; without a placed map the errors are NaN."""
    placed = prediction.placed
    components = {int(c) for c in prediction.component[placed & np.isfinite(errors.error_m)]}
    known_m, known_deg = errors.error_m[np.isfinite(errors.error_m)], errors.error_deg[np.isfinite(errors.error_deg)]
    empty = known_m.size == 0
    return Placement(
        num_maps=len(placed),
        num_placed=int(placed.sum()),
        num_wrong=int(errors.wrong.sum()),
        num_components=len(components),
        success=bool(placed.all() and len(np.unique(prediction.component)) == 1 and not errors.wrong.any()),
        max_error_m=float("nan") if empty else float(known_m.max()),
        max_error_deg=float("nan") if empty else float(known_deg.max()),
        median_error_m=float("nan") if empty else float(np.median(known_m)),
        median_error_deg=float("nan") if empty else float(np.median(known_deg)),
    )


def motion_errors(T_true: Array, T_estimated: Array) -> tuple[Array, Array]:
    """Length in metres and absolute angle in degrees of ``inv(T_true) @ T_estimated``: (..., 3, 3) to two (...)."""
    E = se2.invert(T_true) @ T_estimated
    return np.hypot(E[..., 0, 2], E[..., 1, 2]), np.rad2deg(np.abs(se2.angle_of(E)))


def fit_frame(T_world_map: Array, T_ref_map: Array) -> Array:
    """The frame ``T_world_ref`` that fits most of a component's maps.

    Each map proposes the frame in which itself is exact. A proposal is refitted by least squares over the maps within
    the bounds of *wrong*, as long as that loses none of them. The proposal with the most maps within the bounds
    wins; among equals the one with the smaller sum of squared errors over these maps.

    Args:
        T_world_map: (N, 3, 3) true poses, N at least 1.
        T_ref_map: (N, 3, 3) estimated motions of the same maps.

    Returns:
        (3, 3) motion ``T_world_ref``.
    """
    frames = T_world_map @ se2.invert(T_ref_map)
    error_m, error_deg = motion_errors(T_world_map, frames[:, None] @ T_ref_map)
    starts = [_weigh(*errors) for errors in zip(error_m, error_deg, strict=True)]
    refits: dict[bytes, _Fit] = {}
    candidates = [
        _refit(_Fit(T, *start), T_world_map, T_ref_map, refits) for T, start in zip(frames, starts, strict=True)
    ]
    ranks = [(-fit.within.sum(), fit.cost, k) for k, fit in enumerate(candidates)]
    return candidates[min(ranks)[2]].T_world_ref


def align_poses(T_world_map: Array, T_ref_map: Array) -> Array:
    """Least-squares ``T_world_ref`` over (N, 3, 3) poses: squared shifts plus squared angles at a lever of 14.3 m."""
    arms = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) * _LEVER_M
    points_world = se2.transform_points(T_world_map, arms).reshape(-1, 2)
    points_ref = se2.transform_points(T_ref_map, arms).reshape(-1, 2)
    mean_world, mean_ref = points_world.mean(axis=0), points_ref.mean(axis=0)
    H = (points_ref - mean_ref).T @ (points_world - mean_world)
    theta = np.arctan2(H[0, 1] - H[1, 0], H[0, 0] + H[1, 1])
    R = se2.make_motion(0.0, 0.0, theta)
    shift = mean_world - se2.transform_points(R, mean_ref[None])[0]
    return se2.make_motion(shift[0], shift[1], theta)


class _Fit(NamedTuple):
    """A proposed frame."""

    T_world_ref: Array
    """(3, 3) the frame."""
    within: npt.NDArray[np.bool_]
    """(N,) the maps that it fits."""
    cost: float
    """Sum of their squared errors."""


def _refit(fit: _Fit, T_world_map: Array, T_ref_map: Array, refits: dict[bytes, _Fit]) -> _Fit:
    """The proposal after its refits, which depend on nothing but the maps within: each is worked out once."""
    for _ in range(_REFITS if fit.within.any() else 0):  # none: so far away that rounding hides even its own place
        key = fit.within.tobytes()
        if key not in refits:
            frame = align_poses(T_world_map[fit.within], T_ref_map[fit.within])
            refits[key] = _Fit(frame, *_weigh(*motion_errors(T_world_map, frame @ T_ref_map)))
        refitted, before = refits[key], fit.within
        if refitted.within.sum() < before.sum():
            break
        fit = refitted
        if (fit.within == before).all():
            break
    return fit


def _weigh(error_m: Array, error_deg: Array) -> tuple[npt.NDArray[np.bool_], float]:
    """The maps within the bounds, and the sum of their squared errors."""
    within = (error_m <= WRONG_ABOVE_M) & (error_deg <= WRONG_ABOVE_DEG)
    cost = (error_m[within] / WRONG_ABOVE_M) ** 2 + (error_deg[within] / WRONG_ABOVE_DEG) ** 2
    return within, float(cost.sum())
