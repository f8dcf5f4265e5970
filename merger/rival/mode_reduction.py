"""A sum of Gaussians with fewer modes: those that agree are merged [Runnalls07].

A. R. Runnalls: Kullback-Leibler approach to Gaussian mixture reduction, IEEE Transactions on Aerospace and Electronic
Systems, 2007.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.rival.motion_modes import MotionMode

_Array = npt.NDArray[np.float64]


def reduce_modes(modes: Sequence[MotionMode], max_divergence: float) -> list[MotionMode]:
    """Merge the two modes that cost least, again and again, as long as that costs little.

    A merged mode has the sum of the weights and the mean and covariance of the two together, so that those of the
    whole sum stay as they are; of the matches it keeps the larger set.

    Args:
        modes: Modes.
        max_divergence: A merge costs less: the bound B of its Kullback-Leibler divergence (Eq. 21), without its half,
            as MRPT has it.

    Returns:
        The modes that remain, the heaviest first; their weights sum to 1.
    """
    total = sum(mode.weight for mode in modes)
    left = [replace(mode, weight=mode.weight / total) for mode in modes]
    while len(left) > 1:
        costs = _merging_costs(left)
        i, j = divmod(int(np.argmin(costs)), len(left))
        if costs[i, j] >= max_divergence:
            break
        merged = _merge(left[i], left[j])
        left = [mode for k, mode in enumerate(left) if k not in (i, j)] + [merged]
    return sorted(left, key=lambda mode: -mode.weight)


def _merging_costs(modes: Sequence[MotionMode]) -> _Array:
    """(N, N) what it costs to merge two modes, 0 for equal ones; infinite for a mode with itself."""
    weights = np.array([mode.weight for mode in modes])
    covariances = np.stack([mode.covariance for mode in modes])
    means = np.stack([se2.parameters_of(mode.T_target_source) for mode in modes])
    offsets = means[None] - means[:, None]
    offsets[..., 2] = se2.wrap_angle(offsets[..., 2])
    sums = weights[:, None] + weights[None]
    share = (weights[:, None] / sums)[..., None, None]
    between = offsets[..., :, None] * offsets[..., None, :]
    joint = share * covariances[:, None] + (1.0 - share) * covariances[None] + share * (1.0 - share) * between
    own = weights * np.linalg.slogdet(covariances)[1]
    costs = sums * np.linalg.slogdet(joint)[1] - own[:, None] - own[None]
    np.fill_diagonal(costs, np.inf)
    return np.asarray(costs)


def _merge(a: MotionMode, b: MotionMode) -> MotionMode:
    """One Gaussian with the weight, mean and covariance of two."""
    weight = a.weight + b.weight
    share = a.weight / weight
    mean = se2.parameters_of(a.T_target_source)
    offset = se2.parameters_of(b.T_target_source) - mean
    offset[2] = se2.wrap_angle(offset[2])
    covariance = share * a.covariance + (1.0 - share) * b.covariance + share * (1.0 - share) * np.outer(offset, offset)
    x_m, y_m, theta_rad = mean + (1.0 - share) * offset
    matches = max(a.matches, b.matches, key=len)
    return MotionMode(se2.make_motion(x_m, y_m, theta_rad), covariance, weight, matches)
