"""``python -m bench.pair_calibration DATASET...``: fit the probability that a motion between two maps is right.

Each dataset gives the motions in question of its pairs and of the groups that a consensus forms, right ones and wrong
ones by its truth; the first maps of neighbouring datasets give strangers. The fit is to the best motion of each, since
the others lose to it in any case. Printed are the coefficients of
`merger.robust.pair_probability.ProbabilityConfig`; how good they are, and those in use, on buildings that the fit has
not seen; recall by overlap at one false accept in 1,000; and the log-odds of the right and wrong steps of a consensus
that accepts nearly everything, from which `ConsensusConfig.min_log_odds` is chosen.
The same datasets give the same text.

Note:
    The coefficients in use were fitted to the best motion of each of 9,069 pairs of 50 buildings: Intel, Fr079 and
    aces in 4 to 22 parts of overlap 0 to 0.3, offices, ``tim``, ``intel`` and ``fr079`` with all lidars and noise
    levels, scan periods of 0.2 to 1.6 s and cells of 0.025 to 0.1 m, and strangers. A fit that had not seen the
    building (the real logs one by one, the others in five parts) has a log loss of 0.046, and 0.036 in the sample;
    the model before, which knew neither near misses nor corners nor what wall the shared floor lets expect nor the
    lead, has 0.066 and 0.056 when fitted alike. Without the lead, which moves few motions, the coefficients of the
    pairs held for groups, too (2,801 best motions, log loss 0.026, most probable wrong one 2.6).

    In 733 steps of a willing consensus on 102 of these sets none led to another place, above log-odds of -1; with the
    model before it were 48 of 3,647 on sets made to mislead, two of them above 3 without support. So
    ``min_log_odds`` asks for 4 still, and `merger.robust.pair_probability.StepProbabilityConfig` stays as it was fitted
    to those steps, with the cycles.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy.optimize

from bench.pair_samples import Samples, collect_samples
from bench.scoring.statistics import wilson_share
from merger.robust.pair_probability import FEATURES, ProbabilityConfig

Array = npt.NDArray[np.float64]

_SIGNS = (0, -1, -1, -1, 1, -1, -1, 1)
"""What each feature may say: conflict and rivals never speak for a motion, corners never against it."""
_RIDGE = 2e-4
"""Weight of the squared standardised coefficients, for each sample."""
_BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 1.0)
_OVERLAPS = (0.1, 0.2, 0.3, 0.5, np.inf)
_APART_BELOW = 0.01
_FALSE_ACCEPTS = 1e-3


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
    """The coefficients, what they are worth on buildings that were not seen, and the steps of consensus, as text."""
    best, in_use = samples.is_best, np.array(ProbabilityConfig().coefficients)
    fitted, right = fit_coefficients(samples.features[best], samples.right[best]), samples.right[best]
    lines = [f"{right.sum()} right and {(~right).sum()} wrong best motions of {len(names)} buildings"]
    lines += ["  coefficient  fitted  in use"]
    lines += [f"  {name:10} {a:8.2f}{b:8.2f}" for name, a, b in zip(FEATURES, fitted, in_use, strict=True)]
    held = hold_out(samples)
    for title, log_odds in (("fitted, each building held out", held), ("in use", samples.features @ in_use)):
        lines += [f"{title}: log loss {log_loss(log_odds[best], right):.4f}", *describe_bins(log_odds[best], right)]
        lines += [describe_recall(log_odds, samples)]
    lines += ["most probable wrong motion of each building, held out and in use:"]
    for number, name in enumerate(names):
        wrong = (samples.building == number) & ~samples.right
        if wrong.any():
            lines += [f"  {name}: {held[wrong].max():.2f} {(samples.features[wrong] @ in_use).max():.2f}"]
    return "\n".join([*lines, describe_steps(samples)])


def hold_out(samples: Samples) -> Array:
    """(S,) log-odds of each motion by the coefficients that the other buildings give."""
    log_odds = np.zeros(len(samples.right))
    for number in np.unique(samples.building):
        out = samples.building == number
        rest = ~out & samples.is_best
        if samples.right[rest].any():
            log_odds[out] = samples.features[out] @ fit_coefficients(samples.features[rest], samples.right[rest])
    return log_odds


def log_loss(log_odds: Array, right: npt.NDArray[np.bool_]) -> float:
    """Mean of ``-log(probability of what is true)``, >= 0."""
    return float(np.logaddexp(0.0, np.where(right, -log_odds, log_odds)).mean())


def describe_bins(log_odds: Array, right: npt.NDArray[np.bool_]) -> list[str]:
    """Of what is called 0.9, how many are right?"""
    chance = 1.0 / (1.0 + np.exp(-log_odds))
    lines = []
    for low, high in pairwise(_BINS):
        inside = (chance >= low) & ((chance < high) | (high == 1.0))
        if inside.any():
            share = wilson_share(int(right[inside].sum()), int(inside.sum()))
            interval = f"{share.low:.3f} to {share.high:.3f}"
            lines.append(
                f"  called {low:.2f} to {high:.2f}: {share.trials} motions, {share.value:.3f} right ({interval})"
            )
    return lines


def describe_recall(log_odds: Array, samples: Samples) -> str:
    """Recall of pairs by true overlap, where at most one in 1,000 pairs that have nothing in common is accepted."""
    best = {p: k for k in np.argsort(log_odds).tolist() if (p := int(samples.pair[k])) >= 0}
    chosen = np.array(sorted(best.values()), dtype=np.int64)
    overlap, right, value = samples.overlap[chosen], samples.right[chosen], log_odds[chosen]
    apart = np.sort(value[overlap < _APART_BELOW])[::-1]
    least = float(apart[int(_FALSE_ACCEPTS * len(apart))]) if len(apart) else -np.inf
    texts = []
    for low, high in pairwise(_OVERLAPS):
        inside = (overlap >= low) & (overlap < high)
        share = wilson_share(int((inside & right & (value > least)).sum()), int(inside.sum()))
        texts.append(f"{low:g} {share.value:.3f} ({share.low:.3f} to {share.high:.3f})")
    return f"  recall of {len(chosen)} pairs, each alone, above log-odds of {least:.2f}, by overlap from " + ", ".join(
        texts
    )


def fit_steps(motion_log_odds: Array, right: npt.NDArray[np.bool_]) -> Array:
    """Constant and slope, (2,), of the log-odds of (J,) steps over their motions', drawn a little to 0 and 1."""
    sign = np.where(right, 1.0, -1.0)

    def loss(w: Array) -> float:
        margin = sign * (w[0] + w[1] * motion_log_odds)
        return float(np.logaddexp(0.0, -margin).sum() + 0.5 * (w[0] ** 2 + (w[1] - 1.0) ** 2))

    return np.asarray(scipy.optimize.minimize(loss, np.array([0.0, 1.0])).x, dtype=np.float64)


def hold_out_steps(samples: Samples) -> Array:
    """(J,) log-odds of each step by the constant and slope that the other buildings give."""
    held = np.zeros(len(samples.step_right))
    for number in np.unique(samples.step_building):
        out = samples.step_building == number
        constant, slope = fit_steps(samples.step_log_odds[~out], samples.step_right[~out])
        held[out] = constant + slope * samples.step_log_odds[out]
    return held


def describe_steps(samples: Samples) -> str:
    """Right and wrong steps of an all too willing consensus by their log-odds, and how sure that makes a step."""
    right, wrong = samples.step_log_odds[samples.step_right], np.sort(samples.step_log_odds[~samples.step_right])
    below = ", ".join(f"{(right < level).sum()} below {level:g}" for level in (2.0, 2.5, 3.0, 4.0, 5.0))
    worst = ", ".join(f"{value:.2f}" for value in wrong[::-1][:5]) or "none"
    lines = [f"steps of consensus: {len(right)} right ({below}); {len(wrong)} wrong, the most probable: {worst}"]
    if len(samples.step_right):
        constant, slope = fit_steps(samples.step_log_odds, samples.step_right)
        lines += [f"log-odds of a step: {constant:.2f} and {slope:.2f} times its motion's; each building held out:"]
        lines += describe_bins(hold_out_steps(samples), samples.step_right)
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status is 0, or 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m bench.pair_calibration", description=str(__doc__).split("\n")[0])
    parser.add_argument("datasets", nargs="+", type=Path, metavar="DATASET", help="dataset folders of python -m sim")
    options = parser.parse_args(argv)
    try:
        samples, names = collect_samples(options.datasets)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"{parser.prog}: {error}\n")
        return 2
    sys.stdout.write(describe_fit(samples, names) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
