"""Are confidences honest? Of what a method calls 0.9, nine in ten ought to be right."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

NUM_BINS = 10
"""Bins of equal width over 0..1."""


@dataclass(frozen=True)
class Reliability:
    """The reliability curve over `NUM_BINS` bins; empty bins are NaN."""

    stated: Array
    """(B,) mean stated confidence of a bin."""
    observed: Array
    """(B,) share of the bin that is right."""
    count: npt.NDArray[np.int64]
    """(B,) members of the bin."""


def brier_score(confidence: Array, right: npt.NDArray[np.bool_]) -> float:
    """Mean of ``(confidence - right)^2`` over the placements that state a confidence; 0 to 1, NaN where none does."""
    known = np.isfinite(confidence)
    return float(np.mean((confidence[known] - right[known]) ** 2)) if known.any() else math.nan


def calibration_error(confidence: Array, right: npt.NDArray[np.bool_]) -> float:
    """Expected calibration error: mean of ``|stated - observed|`` over bins by their count; 0 to 1, NaN if empty."""
    curve = reliability(confidence, right)
    filled = curve.count > 0
    if not filled.any():
        return math.nan
    gaps = np.abs(curve.stated[filled] - curve.observed[filled])
    return float(np.average(gaps, weights=curve.count[filled]))


def reliability(confidence: Array, right: npt.NDArray[np.bool_]) -> Reliability:
    """The reliability curve of (N,) confidences against (N,) outcomes; NaN confidences are left out."""
    known = np.isfinite(confidence)
    bins = np.minimum((confidence[known] * NUM_BINS).astype(np.int64), NUM_BINS - 1)
    count = np.bincount(bins, minlength=NUM_BINS)
    divisor = np.where(count > 0, count, np.nan)
    stated = np.bincount(bins, weights=confidence[known], minlength=NUM_BINS) / divisor
    observed = np.bincount(bins, weights=right[known].astype(np.float64), minlength=NUM_BINS) / divisor
    return Reliability(stated, observed, count)
