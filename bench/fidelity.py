"""Do synthetic data look as real data do? The same statistics of both, and whether they lie in the span of the real."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pandas as pd

from bench.scores import PairScore
from merger import se2
from merger.features import FeatureConfig, extract_features, match_features
from merger.grid_map import GridMap
from sim.carmen import read_carmen
from sim.dataset import Dataset

WIDENED_BY = 0.25
"""Share by which the span of the real logs is widened at either end."""
TRUE_MATCH_WITHIN_M = 0.25
"""A feature match is true if the true motion brings its two places this close."""
OVERLAP_BINS = ((0.0, 0.2), (0.2, 0.4), (0.4, 1.0))
"""Bins of true overlap."""
_MAX_SCANS = 4000
_SCAN_CHUNK = 256


@dataclass(frozen=True)
class Fidelity:
    """Statistics of one dataset; NaN where there is nothing to count."""

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
    """Median error of the placed maps, metres."""


def measure_fidelity(dataset: Dataset, pairs: Sequence[PairScore], median_error_m: float) -> Fidelity:
    """Statistics of a dataset.

    Args:
        dataset: Maps, truth, and the folder with ``scans.log``.
        pairs: What the method ``paper`` said about its pairs.
        median_error_m: Its median error.
    """
    maps, truth = dataset.maps, dataset.truth
    free_m2 = sum(float(m.free.sum()) * m.resolution_m**2 for m in maps)
    low, mid, high, no_return = _range_statistics(dataset.path / "scans.log")
    features = [extract_features(m, FeatureConfig()) for m in maps]
    matches = _true_matches(maps, truth.T_world_map, truth.overlap)
    right = [_share([p.right for p in pairs if a < p.overlap_true <= b]) for a, b in OVERLAP_BINS]
    wrong_motion = [not math.isnan(p.error_m) for p in pairs if not p.right]
    return Fidelity(
        free_area_m2=free_m2 / len(maps),
        occupied_per_m2=sum(int(m.occupied.sum()) for m in maps) / free_m2,
        range_10_m=low,
        range_50_m=mid,
        range_90_m=high,
        no_return=no_return,
        wall_cells=float(np.mean([wall_thickness(m) for m in maps])),
        keypoints_per_m2=sum(len(f.points_grid) for f in features) / free_m2,
        true_matches_low=matches[0],
        true_matches_mid=matches[1],
        true_matches_high=matches[2],
        right_low=right[0],
        right_mid=right[1],
        right_high=right[2],
        false_pass=_share(wrong_motion),
        median_error_m=median_error_m,
    )


def compare_fidelity(statistics: dict[str, Fidelity], real: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """Statistics side by side, one row each, with the span of the real logs and which synthetic ones lie outside.

    Args:
        statistics: By dataset.
        real: Which of them are real.

    Returns:
        The table, and a sentence for every statistic that lies outside.
    """
    rows, sentences = [], []
    for name in Fidelity.__dataclass_fields__:
        values = {label: float(asdict(found)[name]) for label, found in statistics.items()}
        known = [values[label] for label in real if math.isfinite(values[label])]
        low, high = (min(known) * (1 - WIDENED_BY), max(known) * (1 + WIDENED_BY)) if known else (math.nan, math.nan)
        outside = [k for k, v in values.items() if k not in real and known and not low <= v <= high]
        rows.append({"statistic": name, **values, "from": low, "to": high, "outside": ", ".join(outside)})
        sentences += [f"{k}: {name} is {values[k]:.3g}, outside {low:.3g} to {high:.3g}." for k in outside]
    return pd.DataFrame(rows), sentences


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


def _true_matches(
    maps: Sequence[GridMap], T_world_map: npt.NDArray[np.float64], overlap: npt.NDArray[np.float64]
) -> list[float]:
    """Mean number of true matches of the pairs in each bin of overlap."""
    config = FeatureConfig()
    features = [extract_features(m, config) for m in maps]
    places = [
        se2.transform_points(T @ m.T_map_grid, f.points_grid)
        for T, m, f in zip(T_world_map, maps, features, strict=True)
    ]
    counts: list[tuple[float, int]] = []
    for i in range(len(maps)):
        for j in range(i + 1, len(maps)):
            found = match_features(features[i], features[j], config)
            apart = np.linalg.norm(places[i][found[:, 0]] - places[j][found[:, 1]], axis=1)
            counts.append((float(max(overlap[i, j], overlap[j, i])), int((apart <= TRUE_MATCH_WITHIN_M).sum())))
    return [_share([n for shared, n in counts if a < shared <= b]) for a, b in OVERLAP_BINS]


def _share(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan
