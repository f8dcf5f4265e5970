"""Statistics by which synthetic data can be set beside real data: what maps and scans look like to a merger."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from bench.scoring.score_rows import PairScore
from merger import se2
from merger.features import FeatureConfig, Features, extract_features, match_features
from merger.grid_map import GridMap
from sim.datasets.dataset import Dataset
from sim.recordings.carmen import read_carmen

TRUE_MATCH_WITHIN_M = 0.25
"""A feature match is true if the true motion brings its two places this close."""
OVERLAP_BINS = ((0.0, 0.2), (0.2, 0.4), (0.4, 1.0))
"""Bins of true overlap."""
SHARES = ("right_low", "right_mid", "right_high", "false_pass")
"""Statistics that are shares of pairs."""
_MAX_SCANS = 4000
_SCAN_CHUNK = 256


@dataclass(frozen=True)
class FidelityRun:
    """One cut of a building, and what ``paper`` made of it."""

    dataset: Dataset
    """Maps, truth, and the folder with ``scans.log``."""
    pairs: Sequence[PairScore]
    """What the method said about its pairs."""
    median_error_m: float
    """Its median error."""


@dataclass(frozen=True)
class Fidelity:
    """Statistics of all runs of a building; NaN where there is nothing to count."""

    free_area_m2: float
    """Mean free area of a submap, square metres."""
    occupied_per_m2: float
    """Occupied cells for a square metre of free area."""
    range_10_m: float
    """10 % quantile of the ranges that returned, metres."""
    range_50_m: float
    """Median of the ranges that returned, metres."""
    range_90_m: float
    """90 % quantile of the ranges that returned, metres."""
    no_return: float
    """Share of beams without return."""
    wall_cells: float
    """Thickness of walls in cells: occupied cells over cells of their skeleton."""
    keypoints_per_m2: float
    """SIFT keypoints for a square metre of free area."""
    true_matches_low: float
    """Mean number of true feature matches of pairs with overlap in (0, 0.2]."""
    true_matches_mid: float
    """The same in (0.2, 0.4]."""
    true_matches_high: float
    """The same in (0.4, 1]."""
    right_low: float
    """Share of pairs with overlap in (0, 0.2] whose motion, before confirmation, is right."""
    right_mid: float
    """The same in (0.2, 0.4]."""
    right_high: float
    """The same in (0.4, 1]."""
    false_pass: float
    """Share of the pairs without a right motion that pass the gate of four inliers with a wrong one."""
    median_error_m: float
    """Median error of the placed maps, metres: mean over the runs that placed any."""
    num_pairs: dict[str, int] = field(default_factory=dict)
    """Of the statistics that are shares: how many pairs were counted."""


def measure_fidelity(runs: Sequence[FidelityRun]) -> Fidelity:
    """Statistics of one building or log, over all its runs.

    Args:
        runs: Its cuts, at least one.
    """
    maps = [grid for run in runs for grid in run.dataset.maps]
    pairs = [pair for run in runs for pair in run.pairs]
    free_m2 = sum(float(m.free.sum()) * m.resolution_m**2 for m in maps)
    logs = {run.dataset.config["seed"]: run.dataset.path / "scans.log" for run in runs}
    low, mid, high, no_return = np.mean([_range_statistics(log) for log in logs.values()], axis=0)
    keypoints, matches = _count_features([run.dataset for run in runs])
    right = [[p.right for p in pairs if a < p.overlap_true <= b] for a, b in OVERLAP_BINS]
    wrong_motion = [not math.isnan(p.error_m) for p in pairs if not p.right]
    errors_m = [run.median_error_m for run in runs if math.isfinite(run.median_error_m)]
    return Fidelity(
        free_area_m2=free_m2 / len(maps),
        occupied_per_m2=sum(int(m.occupied.sum()) for m in maps) / free_m2,
        range_10_m=float(low),
        range_50_m=float(mid),
        range_90_m=float(high),
        no_return=float(no_return),
        wall_cells=float(np.mean([wall_thickness(m) for m in maps])),
        keypoints_per_m2=keypoints / free_m2,
        true_matches_low=matches[0],
        true_matches_mid=matches[1],
        true_matches_high=matches[2],
        right_low=_share(right[0]),
        right_mid=_share(right[1]),
        right_high=_share(right[2]),
        false_pass=_share(wrong_motion),
        median_error_m=_share(errors_m),
        num_pairs=dict(zip(SHARES, [*map(len, right), len(wrong_motion)], strict=True)),
    )


def wall_thickness(grid: GridMap) -> float:
    """Occupied cells over the cells of their skeleton (thinned by repeated opening); NaN without walls."""
    walls = grid.occupied.astype(np.uint8)
    skeleton, cross = np.zeros_like(walls), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    rest = walls
    while rest.any():
        eroded = np.asarray(cv2.erode(rest, cross), dtype=np.uint8)
        skeleton |= rest & ~np.asarray(cv2.dilate(eroded, cross), dtype=np.uint8)
        rest = eroded
    return float(walls.sum() / skeleton.sum()) if skeleton.any() else math.nan


def _range_statistics(log: Path) -> tuple[float, float, float, float]:
    """Three quantiles of the ranges that returned, and the share of beams without return."""
    if not log.is_file():
        return math.nan, math.nan, math.nan, math.nan
    returned: list[npt.NDArray[np.float32]] = []
    num_beams = 0
    for run in read_carmen(log):
        stride = max(run.num_scans // _MAX_SCANS, 1)
        for first in range(0, run.num_scans, _SCAN_CHUNK):
            ranges = run.read_ranges(first, min(first + _SCAN_CHUNK, run.num_scans))[::stride]
            returned.append(ranges[np.isfinite(ranges)])
            num_beams += ranges.size
    known = np.concatenate(returned)
    low, mid, high = np.quantile(known, [0.1, 0.5, 0.9])
    return float(low), float(mid), float(high), 1.0 - known.size / num_beams


def _count_features(datasets: Sequence[Dataset]) -> tuple[int, list[float]]:
    """Number of keypoints, and the mean number of true matches of the pairs in each bin of overlap."""
    num_keypoints, counts = 0, []
    for dataset in datasets:
        features = [extract_features(m, FeatureConfig()) for m in dataset.maps]
        num_keypoints += sum(len(f.points_grid) for f in features)
        counts += _true_matches(dataset, features)
    return num_keypoints, [_share([n for shared, n in counts if a < shared <= b]) for a, b in OVERLAP_BINS]


def _true_matches(dataset: Dataset, features: Sequence[Features]) -> list[tuple[float, int]]:
    """Overlap and number of true matches of each pair."""
    truth = dataset.truth
    places = [
        se2.transform_points(T @ m.T_map_grid, f.points_grid)
        for T, m, f in zip(truth.T_world_map, dataset.maps, features, strict=True)
    ]
    counts = []
    for i, j in itertools.combinations(range(len(places)), 2):
        found = match_features(features[i], features[j], FeatureConfig())
        apart = np.linalg.norm(places[i][found[:, 0]] - places[j][found[:, 1]], axis=1)
        shared = float(max(truth.overlap[i, j], truth.overlap[j, i]))
        counts.append((shared, int((apart <= TRUE_MATCH_WITHIN_M).sum())))
    return counts


def _share(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan
