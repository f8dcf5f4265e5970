"""Shares with their uncertainty, and where they fall: Wilson intervals and breaking points."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

_Z_95 = 1.959963984540054


@dataclass(frozen=True)
class Share:
    """A share of successes with its 95 % interval."""

    value: float
    """successes / trials; NaN without trials."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""
    successes: int
    """Successes."""
    trials: int
    """Trials."""


def wilson_share(successes: int, trials: int) -> Share:
    """Share with Wilson's 95 % score interval (Wilson 1927); without trials NaN within [0, 1].

    Raises:
        ValueError: successes are not between 0 and trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"successes must be within [0, {trials}], got {successes}")
    if trials == 0:
        return Share(math.nan, 0.0, 1.0, 0, 0)
    p, z2 = successes / trials, _Z_95**2
    centre = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    half = _Z_95 / (1 + z2 / trials) * math.sqrt(p * (1 - p) / trials + z2 / (4 * trials**2))
    low = 0.0 if successes == 0 else centre - half
    high = 1.0 if successes == trials else centre + half
    return Share(p, low, high, successes, trials)


def breaking_point(values: Sequence[float], shares: Sequence[float], level: float, hard_is_high: bool) -> float:
    """The swept value at which a success rate, coming from the easy end, first falls below a level.

    Linear interpolation between the two neighbouring values. NaN where it never falls below; the easiest value itself
    where it starts below.

    Args:
        values: Swept values, in any order.
        shares: Success rate at each value, 0 to 1.
        level: 0.9 or 0.5, say.
        hard_is_high: Whether larger values are harder (noise), rather than smaller ones (overlap).
    """
    points = sorted(zip(values, shares, strict=True), reverse=not hard_is_high)
    for k, (value, share) in enumerate(points):
        if share < level:
            if k == 0:
                return value
            before, above = points[k - 1]
            return before + (value - before) * (above - level) / (above - share)
    return math.nan
