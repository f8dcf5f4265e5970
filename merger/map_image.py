"""The picture of a map: grey values and transparency of any image that OpenCV decodes."""

import re
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

_PNM = re.compile(rb"P([2356])" + rb"(?:\s|#[^\n]*\n)+(\d+)" * 3 + rb"\s")
"""Head of a portable grey or colour map: kind, width, height, and the value of white."""


def decode_image(data: bytes) -> npt.NDArray[np.uint8]:
    """Decode an image file to grey values; colours count by their mean.

    Args:
        data: The bytes of the file.

    Returns:
        (H, W, C) pixels 0..255, C = 1 grey or 2 grey and alpha.

    Raises:
        ValueError: the bytes are no image, or have other than 8 or 16 bits a channel.
    """
    pixels = _decode(data)
    if pixels is None:
        raise ValueError("is not an image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"must have 8 or 16 bits a channel, has {pixels.dtype}")
    pixels = _stretch(pixels, _white_of(data, pixels.dtype))
    if pixels.ndim == 2:
        return pixels[:, :, None]
    grey = np.rint(pixels[:, :, :3].mean(axis=2)).astype(np.uint8)
    channels = [grey] if pixels.shape[2] == 3 else [grey, pixels[:, :, 3]]
    return np.stack(channels, axis=2)


def _decode(data: bytes) -> npt.NDArray[Any] | None:
    """The image; none if there is none, without a word from OpenCV."""
    if not data:
        return None
    if data[:2] in (b"P1", b"P2", b"P3"):
        data += b"\n"  # OpenCV takes a last number that nothing follows for a broken file.
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)


def _white_of(data: bytes, dtype: npt.DTypeLike) -> int:
    """The value that means white: OpenCV stretches a portable map to it only where that is text of 8 bits."""
    head = _PNM.match(data)
    is_stretched = head is None or (head[1] in b"23" and dtype == np.uint8)
    return int(np.iinfo(dtype).max) if head is None or is_stretched else int(head[4])


def _stretch(pixels: npt.NDArray[Any], white: int) -> npt.NDArray[np.uint8]:
    """Pixels as 8 bits, white at 255."""
    if white == 65_535:
        return (pixels >> 8).astype(np.uint8)
    values = np.rint(np.minimum(np.arange(np.iinfo(pixels.dtype).max + 1) / white, 1.0) * 255.0)
    return pixels if white == 255 and pixels.dtype == np.uint8 else values.astype(np.uint8)[pixels]
