"""The highest local maxima of an image, in one pass (numba)."""

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

Image = npt.NDArray[np.float32]


def find_peaks(image: Image, count: int) -> list[tuple[float, int, int]]:
    """The highest local maxima among eight neighbours; the image wraps around at its borders.

    Args:
        image: (H, W) values.
        count: How many to return at most, >= 1.

    Returns:
        Value, row and column of each, highest first; of equal ones the first row and column first.
    """
    values, rows, cols = _find_peaks(image, count)
    return [(float(v), int(r), int(c)) for v, r, c in zip(values, rows, cols, strict=True) if r >= 0]


@njit(cache=True, nogil=True)
def _find_peaks(image: Image, count: int) -> Any:
    height, width = image.shape
    values = np.full(count, -np.inf, np.float32)
    rows, cols = np.full(count, -1), np.full(count, -1)
    for row in range(height):
        above, below = image[row - 1], image[(row + 1) % height]
        for col in range(width):
            value = image[row, col]
            if value <= values[count - 1]:
                continue
            left, right = col - 1, (col + 1) % width
            if (
                value < image[row, left]
                or value < image[row, right]
                or value < above[col]
                or value < below[col]
                or value < above[left]
                or value < above[right]
                or value < below[left]
                or value < below[right]
            ):
                continue
            place = count - 1
            while place > 0 and values[place - 1] < value:
                values[place], rows[place], cols[place] = values[place - 1], rows[place - 1], cols[place - 1]
                place -= 1
            values[place], rows[place], cols[place] = value, row, col
    return values, rows, cols
