"""Cuts by what matters: submaps whose neighbours see a given share of the same walls, however many scans that takes."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from sim.maps.mapping import OccupancyConfig
from sim.maps.submap_mapping import MappingConfig, PoseSource, map_submap
from sim.maps.submaps import SubmapCut, cut_submaps
from sim.maps.truth import overlap_fractions
from sim.robot_run import RobotRun

TOLERANCE = 0.01
"""The search ends this near its target."""
_LADDER = (0.9, 0.7, 0.5, 0.3, 0.1, -0.2, -0.6, -1.2, -2.0, -4.0, -8.0)
"""Shares of common scans that are tried; below zero scans are left out between submaps."""
_MAX_HALVINGS = 10


def find_cuts(runs: Sequence[RobotRun], count: int, target: float, occupancy: OccupancyConfig) -> list[SubmapCut]:
    """Cut runs so that neighbouring submaps overlap by a given amount, as measured in their maps.

    The share of common scans is lowered step by step until the overlap falls below the target, then halved into the
    last step (with scans left out, overlap need not fall on and on: robots come back). Maps are made at the true poses
    for it, so that the answer does not depend on how submaps are mapped later. Overlap of neighbours: see
    `neighbour_overlap`.

    Args:
        runs: The runs of all robots.
        count: Submaps of all robots together.
        target: Wanted overlap, in (0, 1).
        occupancy: How scans become cells.

    Raises:
        ValueError: no cut comes near the target.
    """
    num_scans = [run.num_scans for run in runs]
    trials: list[tuple[float, float, list[SubmapCut]]] = []

    def measure(share: float) -> float:
        cuts = cut_submaps(num_scans, count, share)
        measured = neighbour_overlap(runs, cuts, occupancy)
        trials.append((abs(measured - target), measured, cuts))
        return measured

    high = low = _LADDER[0]
    for share in _LADDER:
        high, low = low, share
        if not measure(share) > target:
            break
    for _ in range(_MAX_HALVINGS):
        if min(trials, key=_distance)[0] <= TOLERANCE:
            break
        middle = (low + high) / 2.0
        low, high = (low, middle) if measure(middle) > target else (middle, high)
    distance, measured, cuts = min(trials, key=_distance)
    if not distance <= 3 * TOLERANCE:
        raise ValueError(
            f"submaps.measured_overlap={target:g} cannot be met with {count} submaps: the nearest is {measured:.2f}"
        )
    return cuts


def neighbour_overlap(runs: Sequence[RobotRun], cuts: Sequence[SubmapCut], occupancy: OccupancyConfig) -> float:
    """Mean overlap of neighbouring submaps of one robot, of both directions, in maps at the true poses; 0 to 1.

    NaN where no robot has two submaps.
    """
    config = MappingConfig(poses=PoseSource.TRUTH, occupancy=occupancy)
    values = []
    for first, second in itertools.pairwise(cuts):
        if first.robot == second.robot:
            pair = (first, second)
            run = runs[first.robot]
            poses = [run.trajectory.T_world_robot[cut.start] for cut in pair]
            grids = [
                map_submap(run, cut.start, cut.stop, config, name=cut.name, T_map_first=np.eye(3)).grid for cut in pair
            ]
            fraction = overlap_fractions(grids, np.stack(poses))
            values.append((fraction[0, 1] + fraction[1, 0]) / 2.0)
    return float(np.mean(values)) if values else float("nan")


def _distance(trial: tuple[float, float, list[SubmapCut]]) -> float:
    """How far a trial is from the target; infinity where nothing was measured."""
    return math.inf if math.isnan(trial[0]) else trial[0]
