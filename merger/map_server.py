"""Occupancy grids on disk, in the format of ROS's `map_server`: a YAML beside an image.

Row 0 of the image is the largest y; ``origin`` is the pose (x, y, yaw) of the lower-left corner of the lower-left
pixel; the image's path is relative to the YAML. Read: the modes ``trinary``, ``scale`` and ``raw``, in small or
capital letters, any image that OpenCV decodes, an alpha channel (transparent is unknown). Written: trinary PGM
(0 occupied, 254 free, 205 unknown).
"""

import json
import math
import os
import re
import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import yaml

from merger import grid_map, se2
from merger.grid_map import GridMap
from merger.map_image import decode_image
from merger.whole_file import write_whole

_PIXEL_OCCUPIED, _PIXEL_FREE, _PIXEL_UNKNOWN = 0, 254, 205
_MODES = ("trinary", "scale", "raw")
_LARGEST_YAML = 10_000
"""Characters; a longer file is no map's, and a deeply nested one would end the process within libyaml."""
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Safe, and ten times as fast where libyaml is there."""


class MapFileError(ValueError):
    """A map file cannot be used; the message is one line that names the file and the fault."""


@dataclass(frozen=True)
class _Header:
    """What a map's YAML says."""

    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_probability: float
    free_probability: float
    mode: str


def read_map(path: str | os.PathLike[str]) -> GridMap:
    """Read one map by its YAML file; its name is the file's stem.

    Raises:
        MapFileError: the YAML or its image is missing, empty, malformed or out of range.
    """
    path = Path(path)
    header = _read_header(path)
    log_odds = _log_odds_from_pixels(_read_pixels(path, header)[::-1], header)
    try:
        return GridMap(path.stem, log_odds, header.resolution_m, se2.make_motion(*header.origin))
    except ValueError as error:
        raise MapFileError(f"{path}: {error}") from None


def write_map(path: str | os.PathLike[str], grid: GridMap) -> None:
    """Write a map as trinary PGM and YAML, both or none.

    Args:
        path: The YAML file to write; the image gets the same stem and ``.pgm``.
        grid: The map; log-odds are reduced to occupied, free and unknown.
    """
    write_whole(encode_map(Path(path), grid))


def encode_map(path: Path, grid: GridMap) -> dict[Path, bytes]:
    """The files that `write_map` writes, the image first: their paths and bytes."""
    pixels = np.full(grid.log_odds.shape, _PIXEL_UNKNOWN, dtype=np.uint8)
    pixels[grid.free] = _PIXEL_FREE
    pixels[grid.occupied] = _PIXEL_OCCUPIED
    rows, cols = grid.log_odds.shape
    image = path.with_suffix(".pgm")
    x, y, yaw = (float(v) for v in se2.parameters_of(grid.T_map_grid))
    header = (
        f"image: {_yaml_text(image.name)}\nmode: trinary\n"
        f"resolution: {grid.resolution_m!r}\norigin: [{x!r}, {y!r}, {yaw!r}]\n"
        f"negate: 0\noccupied_thresh: {grid_map.OCCUPIED_PROBABILITY}\nfree_thresh: {grid_map.FREE_PROBABILITY}\n"
    )
    return {image: b"P5\n%d %d\n255\n" % (cols, rows) + pixels[::-1].tobytes(), path: header.encode()}


def _yaml_text(name: str) -> str:
    """A file's name as YAML reads it: in quotes, unless it is plain."""
    return name if re.fullmatch(r"\w[\w.-]*( [\w.-]+)*", name) else json.dumps(name, ensure_ascii=False)


def _read_header(path: Path) -> _Header:
    document = _read_yaml(path)
    resolution_m = _number(path, document, "resolution")
    if fault := grid_map.resolution_fault(resolution_m):
        raise MapFileError(f"{path}: {fault}")
    image = document.get("image")
    if not isinstance(image, str) or not image:
        raise MapFileError(f"{path}: field 'image' is missing or not a file name")
    mode = str(document.get("mode", "trinary")).lower()
    if mode not in _MODES:
        raise MapFileError(f"{path}: mode must be one of {', '.join(_MODES)}, got '{mode}'")
    occupied = _number(path, document, "occupied_thresh", grid_map.OCCUPIED_PROBABILITY)
    free = _number(path, document, "free_thresh", grid_map.FREE_PROBABILITY)
    if not 0.0 <= free < occupied <= 1.0:
        raise MapFileError(f"{path}: need 0 <= free_thresh < occupied_thresh <= 1, got {free:g} and {occupied:g}")
    negate = bool(_number(path, document, "negate", 0.0))
    return _Header(path.parent / image, resolution_m, _origin(path, document), negate, occupied, free, mode)


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise MapFileError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise MapFileError(f"{path}: cannot be read ({type(error).__name__})") from None
    if not text.strip():
        raise MapFileError(f"{path}: the file is empty")
    if len(text) > _LARGEST_YAML:
        raise MapFileError(f"{path}: too long for a map_server YAML ({len(text)} characters)")
    try:
        document = yaml.load(text, Loader=_LOADER)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise MapFileError(f"{path}: not YAML ({' '.join(str(error).split())})") from None
    if not isinstance(document, dict):
        raise MapFileError(f"{path}: not a map_server YAML (no fields)")
    return document


def _number(path: Path, document: dict[str, Any], key: str, default: float | None = None) -> float:
    value = document.get(key, default)
    if value is None:
        raise MapFileError(f"{path}: field '{key}' is missing")
    try:
        number = math.nan if isinstance(value, bool) and key != "negate" else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise MapFileError(f"{path}: field '{key}' must be a finite number, got {reprlib.repr(value)}")
    return number


def _origin(path: Path, document: dict[str, Any]) -> tuple[float, float, float]:
    value = document.get("origin")
    if not isinstance(value, list) or len(value) != 3:
        raise MapFileError(f"{path}: field 'origin' is missing or not a list of three numbers [x, y, yaw]")
    x, y, yaw = (_number(path, {"origin": item}, "origin") for item in value)
    return x, y, yaw


def _read_pixels(path: Path, header: _Header) -> npt.NDArray[np.uint8]:
    """The image as (H, W, C) uint8, C = 1 grey or 2 grey and alpha."""
    try:
        return decode_image(header.image.read_bytes())
    except OSError:
        raise MapFileError(f"{path}: its image {header.image.name} does not exist or cannot be read") from None
    except ValueError as error:
        raise MapFileError(f"{path}: its image {header.image.name} {error}") from None


def _log_odds_from_pixels(pixels: npt.NDArray[np.uint8], header: _Header) -> npt.NDArray[np.float32]:
    """Log-odds by map_server's rules, in the order of the pixels: one look-up each."""
    log_odds = np.asarray(cv2.LUT(np.ascontiguousarray(pixels[:, :, 0]), _log_odds_of_greys(header)), np.float32)
    if pixels.shape[2] == 2:
        log_odds[pixels[:, :, 1] < 255] = 0.0
    return log_odds


def _log_odds_of_greys(header: _Header) -> npt.NDArray[np.float32]:
    """(256,) what each grey value means."""
    grey = np.arange(256)
    if header.mode == "raw":
        occupancy = np.where(grey <= 100, grey / 100.0, 0.5)
        occupied, free = occupancy >= header.occupied_probability, occupancy <= header.free_probability
    else:
        occupancy = grey / 255.0 if header.negate else (255.0 - grey) / 255.0
        occupied, free = occupancy > header.occupied_probability, occupancy < header.free_probability
    if header.mode == "trinary":
        occupancy = np.full(grey.shape, 0.5)
    return grid_map.log_odds_from_probability(occupancy, occupied, free)
