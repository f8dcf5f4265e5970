"""The highest local maxima of an image, and of all images those that are apart and worth their time."""

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]
Numbers = npt.NDArray[np.intp]

_NEIGHBOURS = np.ones((3, 3), dtype=np.uint8)


def find_peaks(image: Image, count: int, least: float = -np.inf) -> tuple[Image, Numbers, Numbers]:
    """The highest local maxima among eight neighbours, fewer at the borders.

    Args:
        image: (H, W) values.
        count: How many to return at most, >= 1.
        least: Lower values are none.

    Returns:
        (P,) values, rows and columns, highest first; of equal ones the first row and column first.
    """
    if image.max() < least:
        return image[:0, 0], np.zeros(0, np.intp), np.zeros(0, np.intp)
    needed = cv2.dilate(image, _NEIGHBOURS)
    np.maximum(needed, np.float32(least), out=needed)
    peaks = np.flatnonzero(image >= needed)
    values = image.ravel()[peaks]
    if len(peaks) > count:
        high = np.flatnonzero(values >= np.partition(values, -count)[-count])
        peaks, values = peaks[high], values[high]
    best = np.argsort(-values, kind="stable")[:count]
    rows, cols = np.divmod(peaks[best], image.shape[1])
    return values[best], rows, cols


def least_worth(values: npt.NDArray[np.floating], min_share: float) -> float:
    """The value below which peaks are hopeless beside these (P,): a share of the best one, if that is positive."""
    best = float(values.max(initial=-np.inf))
    return min_share * best if best > 0.0 else -np.inf


def separate_peaks(places_m: Array, angles_rad: Array, apart: tuple[float, float], count: int) -> list[int]:
    """Choose peaks without the weaker of two that are nearly the same.

    Args:
        places_m: (P, 2) places of the peaks, best first.
        angles_rad: (P,) rotations of their images.
        apart: Peaks nearer than this, metres, and turned by less than this, radians, are the same.
        count: How many to choose at most.

    Returns:
        Rising numbers of the chosen ones.
    """
    chosen: list[int] = []
    left = np.ones(len(angles_rad), dtype=np.bool_)
    while left.any() and len(chosen) < count:
        best = int(left.argmax())
        chosen.append(best)
        turned = np.abs(se2.wrap_angle(angles_rad - angles_rad[best])) > apart[1]
        left &= turned | (np.hypot(*(places_m - places_m[best]).T) > apart[0])
    return chosen
