"""Images turned and correlated in Fourier space, in single precision."""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.float32]
Spectrum = npt.NDArray[np.complex64]


def turn_image(image: Image, angle_rad: float) -> Image:
    """Turn a square image about its middle, counter-clockwise in the frame x = column, y = row."""
    middle = (len(image) - 1) / 2.0
    matrix = cv2.getRotationMatrix2D((middle, middle), -np.degrees(angle_rad), 1.0)
    return np.asarray(cv2.warpAffine(image, matrix, image.shape[::-1], flags=cv2.INTER_LINEAR), np.float32)


def find_spectrum(image: Image, shape: tuple[int, ...]) -> Spectrum:
    """The left half, (H, W // 2 + 1), of an image's spectrum, the image filled with zeros to a (H, W) shape."""
    padded = np.zeros(shape, np.float32)
    padded[: image.shape[0], : image.shape[1]] = image
    full = cv2.dft(padded, flags=cv2.DFT_COMPLEX_OUTPUT).view(np.complex64)[:, :, 0]
    return np.ascontiguousarray(full[:, : shape[1] // 2 + 1])


def half_turn(last: int, shape: tuple[int, ...]) -> Spectrum:
    """What turns the conjugate spectrum of a square image into that of the image turned by half a turn.

    Args:
        last: Number of the image's last row and column.
        shape: The (H, W) to which it was filled.
    """
    rows, cols = np.arange(shape[0]) / shape[0], np.arange(shape[1] // 2 + 1) / shape[1]
    return np.asarray(np.exp(-2j * np.pi * last * (rows[:, None] + cols)), np.complex64)


def correlate(source: tuple[Spectrum, Spectrum], target: tuple[Spectrum, Spectrum], shape: tuple[int, ...]) -> Image:
    """Correlate the first image of each with the second one of the other, and add up.

    Args:
        source: Spectra of the two images of the map that moves, turned by half a turn.
        target: Spectra of the two images of the map that stays.
        shape: The (H, W) to which all were filled.

    Returns:
        (H, W) sums for every shift.
    """
    product = source[0] * target[1]
    product += source[1] * target[0]
    return np.asarray(np.fft.irfft2(product, shape), np.float32)
