"""``python -m bench.pair_calibration DATASET...``: fit the probability that a motion between two maps is right.

Each dataset gives its pairs of maps with the motions in question, right ones and wrong ones by its truth; the first
maps of neighbouring datasets give pairs of strangers. Printed are the coefficients of
`merger.pair_probability.ProbabilityConfig`, how well they are calibrated, and, for each dataset left out of the fit,
the most probable wrong motion.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy.optimize

from merger import se2
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig
from merger.pair_probability import FEATURES, features_of
from merger.robust_stages import describe_maps, search_all_pairs
from sim.dataset import read_dataset

Array = npt.NDArray[np.float64]

_SIGNS = (0, -1, -1, -1, 1, -1)
"""What each feature may say: conflict and rivals never speak for a motion, shared floor never against it."""
_RIGHT_M, _RIGHT_DEG = 0.5, 3.0
"""A motion is right within these."""
_WRONG_M, _WRONG_DEG = 0.7, 6.0
"""It is wrong beyond one of these; between, it is left out of the fit."""
_RIDGE = 2e-4
"""Weight of the squared standardised coefficients, for each sample."""
_BINS = (0.0, 0.1, 0.5, 0.8, 0.95, 0.99, 1.0)


@dataclass(frozen=True)
class Samples:
    """Motions in question, with their truth."""

    features: Array
    """(S, F) see `merger.pair_probability.features_of`."""
    right: npt.NDArray[np.bool_]
    """(S,) whether the motion is right."""
    source: npt.NDArray[np.int64]
    """(S,) number of the dataset."""


def collect_samples(datasets: Sequence[Path]) -> Samples:
    """Search all pairs of all datasets, and pairs of strangers between neighbouring datasets.

    Raises:
        ValueError: a folder is no dataset.
    """
    read = [read_dataset(path) for path in datasets]
    rows: list[tuple[Array, bool, int]] = []
    for number, dataset in enumerate(read):
        rows += _judge_pairs(dataset.maps, dataset.truth.T_world_map, number)
    for number, (one, other) in enumerate(pairwise(read)):
        maps = [
            replace(grid, name=f"{side}{k}")
            for side, d in (("a", one), ("b", other))
            for k, grid in enumerate(d.maps[:2])
        ]
        rows += _judge_pairs(maps, None, number)
    features, right, source = zip(*rows, strict=True)
    return Samples(np.array(features), np.array(right), np.array(source))


def _judge_pairs(maps: Sequence[GridMap], T_world_map: Array | None, number: int) -> list[tuple[Array, bool, int]]:
    """Features and truth of all motions in question; without a truth only pairs of strangers count, all wrong."""
    described = describe_maps(maps, MergeConfig(), _quiet)
    rows = []
    for (i, j), motions in search_all_pairs(described, MergeConfig(), _quiet).items():
        center = described[j].structure.center_map
        for motion in motions:
            if T_world_map is None:
                verdict = None if maps[i].name[0] == maps[j].name[0] else False
            else:
                verdict = _is_right(motion.T_target_source, se2.invert(T_world_map[i]) @ T_world_map[j], center)
            if verdict is not None:
                rows.append((features_of(motion.evidence, motion.score_m, motion.rival_score_m), verdict, number))
    return rows


def _is_right(T: Array, T_true: Array, center: Array) -> bool | None:
    """Whether a motion is right at the source's (2,) centre; None between right and wrong."""
    ends = (se2.transform_points(motion, center[None])[0] for motion in (T, T_true))
    shift_m = float(np.linalg.norm(np.subtract(*ends)))
    turn_deg = float(np.degrees(np.abs(se2.angle_of(se2.invert(T_true) @ T))))
    if shift_m < _RIGHT_M and turn_deg < _RIGHT_DEG:
        return True
    return False if shift_m > _WRONG_M or turn_deg > _WRONG_DEG else None


def fit_coefficients(features: Array, right: npt.NDArray[np.bool_]) -> Array:
    """Logistic regression with the signs held: (S, F) features and (S,) outcomes to (F,) coefficients."""
    mean, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-9)
    mean[0], spread[0] = 0.0, 1.0
    scaled = (features - mean) / spread
    sign = np.where(right, 1.0, -1.0)
    penalty = _RIDGE * len(right) * np.array([0.0] + [1.0] * (features.shape[1] - 1))

    def loss(w: Array) -> tuple[float, Array]:
        margin = sign * (scaled @ w)
        slope = -sign / (1.0 + np.exp(np.clip(margin, -500.0, 500.0)))
        value = np.logaddexp(0.0, -margin).sum() + (penalty * w * w).sum()
        return float(value), np.asarray(scaled.T @ slope + 2.0 * penalty * w)

    bounds = [(0.0 if s > 0 else None, 0.0 if s < 0 else None) for s in _SIGNS]
    found = scipy.optimize.minimize(loss, np.zeros(features.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds)
    coefficients = np.asarray(found.x / spread, dtype=np.float64)
    coefficients[0] = found.x[0] - (coefficients[1:] * mean[1:]).sum()
    return coefficients


def describe_fit(samples: Samples, names: Sequence[str]) -> str:
    """The coefficients, their calibration, and the most probable wrong motion of each dataset left out, as text."""
    coefficients = fit_coefficients(samples.features, samples.right)
    log_odds = samples.features @ coefficients
    lines = [f"{samples.right.sum()} right and {(~samples.right).sum()} wrong motions of {len(names)} datasets"]
    lines += [f"  {name:10} {value:8.2f}" for name, value in zip(FEATURES, coefficients, strict=True)]
    chance = 1.0 / (1.0 + np.exp(-log_odds))
    for low, high in pairwise(_BINS):
        inside = (chance >= low) & (chance <= high)
        if inside.any():
            share = samples.right[inside].mean()
            lines.append(f"  called {low:.2f} to {high:.2f}: {inside.sum()} motions, {share:.3f} right")
    for number, name in enumerate(names):
        out = samples.source == number
        if (out & ~samples.right).any() and samples.right[~out].any():
            held = samples.features[out & ~samples.right] @ fit_coefficients(
                samples.features[~out], samples.right[~out]
            )
            lines.append(f"  without {name}: its most probable wrong motion has log-odds of {held.max():.2f}")
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status is 0, or 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m bench.pair_calibration", description=str(__doc__).split("\n")[0])
    parser.add_argument("datasets", nargs="+", type=Path, metavar="DATASET", help="dataset folders of python -m sim")
    options = parser.parse_args(argv)
    try:
        samples = collect_samples(options.datasets)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"{parser.prog}: {error}\n")
        return 2
    sys.stdout.write(describe_fit(samples, [path.name for path in options.datasets]) + "\n")
    return 0


def _quiet(stage: str, done: int, total: int) -> None:
    """Nobody watches."""


if __name__ == "__main__":
    sys.exit(main())
