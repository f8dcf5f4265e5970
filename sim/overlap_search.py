"""Cuts by what matters: submaps whose neighbours see a given share of the same walls, however many scans that takes."""

import itertools
from collections.abc import Sequence

import numpy as np

from sim.mapping import OccupancyConfig
from sim.robot_run import RobotRun
from sim.submap_mapping import MappingConfig, PoseSource, map_submap
from sim.submaps import SubmapCut, cut_submaps
from sim.truth import overlap_fractions

TOLERANCE = 0.01
"""The search ends this near its target."""
_LOWEST, _HIGHEST = -4.0, 0.9
"""Shares of common scans that are tried; below zero scans are left out between submaps."""
_MAX_TRIALS = 14


def find_cuts(runs: Sequence[RobotRun], count: int, target: float, occupancy: OccupancyConfig) -> list[SubmapCut]:
    """Cut runs so that neighbouring submaps overlap by a given amount, as measured in their maps.

    The share of common scans is found by bisection; maps are made at the true poses for it, so that the answer does
    not depend on how submaps are mapped later. Overlap of neighbours: see `neighbour_overlap`.

    Args:
        runs: The runs of all robots.
        count: Submaps of all robots together.
        target: Wanted overlap, in (0, 1).
        occupancy: How scans become cells.

    Raises:
        ValueError: no cut comes near the target.
    """
    num_scans = [run.num_scans for run in runs]
    low, high = _LOWEST, _HIGHEST
    best: tuple[float, float, list[SubmapCut]] | None = None
    for _ in range(_MAX_TRIALS):
        share = (low + high) / 2.0
        cuts = cut_submaps(num_scans, count, share)
        measured = neighbour_overlap(runs, cuts, occupancy)
        if best is None or abs(measured - target) < best[0]:
            best = (abs(measured - target), measured, cuts)
        if abs(measured - target) <= TOLERANCE:
            break
        low, high = (share, high) if measured < target else (low, share)
    if best is None or best[0] > 3 * TOLERANCE:
        reached = "none" if best is None else f"{best[1]:.2f}"
        raise ValueError(
            f"submaps.measured_overlap={target:g} cannot be met with {count} submaps: nearest is {reached}"
        )
    return best[2]


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
