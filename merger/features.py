"""SIFT keypoints of a grid, and their matches in both directions (Sec. 3.1)."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap

_OCCUPIED, _UNKNOWN, _FREE = 0, 230, 254
"""Grey levels of the picture that SIFT sees: walls dark; the border of the explored area, which moves, nearly gone."""


_MARGIN_PX = 8
"""Unknown pixels around the map, so that walls at its border have keypoints, too."""


@dataclass(frozen=True)
class FeatureConfig:
    """Settings of the keypoints and their matches.

    Raises:
        ValueError: a setting is out of its range.
    """

    ratio: float = 0.8
    """A match is kept if its descriptor distance is below this share of the second nearest's [Lowe04]; in (0, 1]."""
    both_directions: bool = True
    """Match source to target as well as target to source, and take the union."""
    pixel_m: float = 0.1
    """Side of a pixel of the picture that SIFT sees, > 0; the same for maps of every resolution."""
    blur_px: float = 1.0
    """Standard deviation of the smoothing before SIFT, >= 0."""
    contrast_threshold: float = 0.04
    """SIFT's contrast threshold, >= 0."""
    max_keypoints: int = 0
    """Keep about as many of the strongest keypoints (equally strong ones stay together), >= 0; 0: all."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not 0.0 < self.ratio <= 1.0:
            raise ValueError(f"features.ratio must be in (0, 1], got {self.ratio}")
        if not self.pixel_m > 0.0:
            raise ValueError(f"features.pixel_m must be > 0, got {self.pixel_m}")
        if self.blur_px < 0.0:
            raise ValueError(f"features.blur_px must be >= 0, got {self.blur_px}")
        if self.contrast_threshold < 0.0:
            raise ValueError(f"features.contrast_threshold must be >= 0, got {self.contrast_threshold}")
        if self.max_keypoints < 0:
            raise ValueError(f"features.max_keypoints must be >= 0, got {self.max_keypoints}")


@dataclass(frozen=True)
class Features:
    """Keypoints of one map."""

    points_grid: npt.NDArray[np.float64]
    """(N, 2) places in metres, frame ``grid``."""
    descriptors: npt.NDArray[np.float32]
    """(N, 128) SIFT descriptors: whole numbers 0..255."""


def extract_features(grid: GridMap, config: FeatureConfig) -> Features:
    """Find the SIFT keypoints of a grid.

    Args:
        grid: The map.
        config: Settings.

    Returns:
        The keypoints in a fixed order; possibly none.
    """
    image, corner_m = _render(grid, config)
    sift = cv2.SIFT.create(nfeatures=config.max_keypoints, contrastThreshold=config.contrast_threshold)
    keypoints, descriptors = sift.detectAndCompute(image, None)
    if not keypoints:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), dtype=np.float32))
    pixels = np.array([keypoint.pt for keypoint in keypoints], dtype=np.float64)
    angles = np.array([keypoint.angle for keypoint in keypoints])
    order = np.lexsort((angles, pixels[:, 1], pixels[:, 0]))
    # A pixel's centre has whole coordinates in OpenCV, halves in the grid.
    return Features(corner_m + (pixels[order] + 0.5) * config.pixel_m, np.asarray(descriptors[order], dtype=np.float32))


def match_features(target: Features, source: Features, config: FeatureConfig) -> npt.NDArray[np.intp]:
    """Match by nearest descriptors with Lowe's ratio test, from source to target and back; the union of both.

    A keypoint with several orientations is one place: of the matches between the same two places one is kept, so
    that it does not count as several.

    Args:
        target: Keypoints of the map that stays.
        source: Keypoints of the map that moves.
        config: Settings.

    Returns:
        (M, 2) indices ``(target, source)``, sorted, each pair of places once.
    """
    if len(target.points_grid) < 2 or len(source.points_grid) < 2:
        return np.zeros((0, 2), dtype=np.intp)
    squared = _squared_distances(target.descriptors, source.descriptors)
    matches = _nearest(np.ascontiguousarray(squared.T), config.ratio)[:, ::-1]
    if config.both_directions:
        matches = np.concatenate([matches, _nearest(squared, config.ratio)])
    matches = np.unique(matches, axis=0)
    places = np.concatenate([target.points_grid[matches[:, 0]], source.points_grid[matches[:, 1]]], axis=1)
    return matches[np.sort(np.unique(places, axis=0, return_index=True)[1])]


def match_many(target: Features, source: Features, margin: float) -> npt.NDArray[np.intp]:
    """Match each keypoint of the target with all whose descriptors are about as near as the nearest [Blanco13].

    Args:
        target: Keypoints of the map that stays.
        source: Keypoints of the map that moves.
        margin: How much farther than the nearest, >= 0, in MRPT's unit for SIFT: the root mean square difference of
            the 128 numbers, over 64.

    Returns:
        (M, 2) indices ``(target, source)``, sorted, many to many, each pair once.
    """
    if len(target.points_grid) == 0 or len(source.points_grid) == 0:
        return np.zeros((0, 2), dtype=np.intp)
    squared = np.maximum(_squared_distances(target.descriptors, source.descriptors), 0.0)
    distances = np.sqrt(squared / target.descriptors.shape[1]) / 64.0
    return np.argwhere(distances <= distances.min(axis=1, keepdims=True) + margin)


def _render(grid: GridMap, config: FeatureConfig) -> tuple[npt.NDArray[Any], npt.NDArray[np.float64]]:
    """The known part of the map as a picture, and its first corner in metres, frame ``grid``."""
    known = grid.log_odds != 0.0
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if len(rows) == 0:
        return np.full((8, 8), _UNKNOWN, dtype=np.uint8), np.zeros(2)
    image = np.full(known.shape, _UNKNOWN, dtype=np.uint8)
    image[grid.free] = _FREE
    image[grid.occupied] = _OCCUPIED
    image = image[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    scale = config.pixel_m / grid.resolution_m
    height, width = (math.ceil(math.ceil(side / scale) * scale) for side in image.shape)
    image = _pad(image, 0, height - image.shape[0], width - image.shape[1])
    shape = (max(1, round(width / scale)), max(1, round(height / scale)))
    image = cv2.resize(image, shape, interpolation=cv2.INTER_AREA if scale >= 1.0 else cv2.INTER_LINEAR)
    image = _pad(image, _MARGIN_PX, _MARGIN_PX, _MARGIN_PX)
    if config.blur_px > 0.0:
        image = cv2.GaussianBlur(image, (0, 0), config.blur_px)
    corner_m = np.array([cols[0], rows[0]]) * grid.resolution_m - _MARGIN_PX * config.pixel_m
    return image, corner_m


def _pad(image: npt.NDArray[Any], before: int, below: int, right: int) -> npt.NDArray[Any]:
    return np.asarray(cv2.copyMakeBorder(image, before, below, before, right, cv2.BORDER_CONSTANT, value=_UNKNOWN))


def _squared_distances(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(N, M) squared distances; exact, because sums of 128 squares of whole numbers below 256 fit a float32."""
    return np.asarray((a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :] - 2.0 * (a @ b.T))


def _nearest(squared: npt.NDArray[np.float32], ratio: float) -> npt.NDArray[np.intp]:
    """(K, 2) row and nearest column, for the rows whose nearest passes the ratio test; ``squared`` is overwritten."""
    rows = np.arange(len(squared))
    nearest = squared.argmin(axis=1)
    first = squared[rows, nearest]
    squared[rows, nearest] = np.inf
    passed = np.flatnonzero(first < ratio * ratio * squared.min(axis=1))
    return np.stack([passed, nearest[passed]], axis=1)
