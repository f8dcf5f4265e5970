"""The highest local maxima of an image."""

import cv2
import numpy as np
import numpy.typing as npt

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
