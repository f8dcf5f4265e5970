"""A page to draw maps on: metres with ticks along two edges, grids laid at their places, a legend at the right."""

import colorsys
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap

_LONGER_SIDE_PX = 1200
_LEFT_PX, _TOP_PX, _BOTTOM_PX, _RIGHT_PX = 90, 20, 75, 20
_LEGEND_PX, _LEGEND_LINE_PX = 190, 26
_NUM_TICKS = 7
_TICK_PX = 6
_OUTLIERS = 0.001
"""Share of the seen cells that may lie beyond each edge of a picture: a beam through a window."""
_SAMPLE = 5
"""Of so many seen cells one is asked how far the picture must reach."""
_MARGIN_M = 1.0
_LINE_PX = 1
_SUBPIXEL_BITS = 4
_INK = (40, 40, 40)

Array = npt.NDArray[np.float64]
Colour = tuple[float, float, float]
"""Blue, green, red, 0 to 255."""


@dataclass(frozen=True)
class Canvas:
    """The part of the world that a picture shows, and what has been drawn of it."""

    low_m: Array
    """(2,) its lower left corner."""
    px_per_m: float
    """Its scale."""
    pixels: npt.NDArray[np.float32]
    """(3, H, W) blue, green, red; row 0 at the top; changed by drawing."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.pixels.shape[1], self.pixels.shape[2]

    @property
    def T_px_world(self) -> Array:
        """(3, 3) maps metres of frame ``world`` to x (right) and y (down) in pixels; a pixel is a unit square."""
        s, height = self.px_per_m, self.size_px[0]
        return np.array([[s, 0.0, -s * self.low_m[0]], [0.0, -s, height + s * self.low_m[1]], [0.0, 0.0, 1.0]])


def make_canvas(building: GridMap) -> Canvas:
    """A white canvas that shows the seen part of a building (frame ``world``)."""
    cells = np.argwhere(building.occupied | building.free)[::_SAMPLE].astype(np.float64)
    points = building.points_map_from_cells(cells + 0.5) if len(cells) else np.zeros((1, 2))
    low = np.quantile(points, _OUTLIERS, axis=0) - _MARGIN_M
    size_m = np.quantile(points, 1.0 - _OUTLIERS, axis=0) + _MARGIN_M - low
    scale = float(_LONGER_SIDE_PX / size_m.max())
    columns, rows = np.maximum(np.rint(size_m * scale).astype(np.int64), 1)
    return Canvas(low, scale, np.full((3, rows, columns), 255.0, dtype=np.float32))


def lay_cells(canvas: Canvas, grid: GridMap, T_world_map: Array, colour: Colour, opacity: tuple[float, float]) -> None:
    """Lay a grid over what has been drawn.

    Args:
        canvas: Changed.
        grid: The map.
        T_world_map: (3, 3) its place.
        colour: Of its cells.
        opacity: Of its occupied and of its free cells, in [0, 1].
    """
    cover: npt.NDArray[np.float32] = np.zeros(grid.log_odds.shape, dtype=np.float32)
    cover[grid.free], cover[grid.occupied] = opacity[1], opacity[0]
    cell_px = grid.resolution_m * canvas.px_per_m
    if cell_px < 1.0:
        size = [max(1, round(side_m * canvas.px_per_m)) for side_m in grid.size_m]
        cover = cv2.resize(cover, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    rows, columns = cover.shape
    to_metres = np.diag([grid.size_m[0] / columns, grid.size_m[1] / rows, 1.0])
    # OpenCV counts from the centres of pixels, not from their corners.
    shift = se2.make_motion(0.5, 0.5, 0.0)
    T = se2.invert(shift) @ canvas.T_px_world @ T_world_map @ grid.T_map_grid @ to_metres @ shift
    how = cv2.INTER_NEAREST if cell_px >= 1.0 else cv2.INTER_LINEAR
    cover = cv2.warpAffine(cover, T[:2], canvas.size_px[::-1], flags=how).astype(np.float32)
    for k, level in enumerate(colour):
        canvas.pixels[k] += cover * (np.float32(level) - canvas.pixels[k])


def draw_way(image: npt.NDArray[np.uint8], canvas: Canvas, points: Array, colour: Colour) -> None:
    """Draw a line through (N, 2) points in metres of frame ``world``, and a ring at the first of them."""
    px = se2.transform_points(canvas.T_px_world, points) - 0.5
    fixed = np.rint(px * 2**_SUBPIXEL_BITS).astype(np.int32)
    cv2.polylines(image, [fixed], False, colour, _LINE_PX, cv2.LINE_AA, _SUBPIXEL_BITS)
    ring = (int(fixed[0, 0]), int(fixed[0, 1]))
    for radius_px, ink in ((7, _INK), (5, colour)):
        cv2.circle(image, ring, radius_px << _SUBPIXEL_BITS, ink, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL_BITS)


def finish_page(canvas: Canvas, image: npt.NDArray[np.uint8], legend: Sequence[tuple[str, Colour]]) -> bytes:
    """A PNG of the canvas's ``image`` (H, W, 3) with a frame, ticks in metres, and a legend."""
    rows, columns = image.shape[:2]
    lines = max((rows + _BOTTOM_PX) // _LEGEND_LINE_PX, 1)
    right = _RIGHT_PX + _LEGEND_PX * math.ceil(len(legend) / lines)
    page = np.full((_TOP_PX + rows + _BOTTOM_PX, _LEFT_PX + columns + right, 3), 255, dtype=np.uint8)
    page[_TOP_PX : _TOP_PX + rows, _LEFT_PX : _LEFT_PX + columns] = image
    cv2.rectangle(page, (_LEFT_PX - 1, _TOP_PX - 1), (_LEFT_PX + columns, _TOP_PX + rows), _INK, 1)
    _draw_ticks(page, canvas)
    for k, (name, colour) in enumerate(legend):
        x = _LEFT_PX + columns + _RIGHT_PX + _LEGEND_PX * (k // lines)
        y = _TOP_PX + _LEGEND_LINE_PX * (k % lines)
        cv2.rectangle(page, (x, y), (x + 15, y + 15), colour, cv2.FILLED)
        _write(page, name, (x + 24, y + 14))
    return cv2.imencode(".png", page, [cv2.IMWRITE_PNG_COMPRESSION, 3])[1].tobytes()


def make_colours(count: int) -> list[Colour]:
    """Distinct dark colours: hues a golden section apart, in three shades."""
    colours: list[Colour] = []
    for index in range(count):
        red, green, blue = colorsys.hsv_to_rgb((0.58 + index * 0.618034) % 1.0, 0.85, (0.80, 0.62, 0.92)[index % 3])
        colours.append((255.0 * blue, 255.0 * green, 255.0 * red))
    return colours


def _draw_ticks(page: npt.NDArray[np.uint8], canvas: Canvas) -> None:
    """Ticks at round numbers of metres along the lower and the left edge, with their numbers."""
    rows, columns = canvas.size_px
    step_m = _round_step(max(rows, columns) / canvas.px_per_m / _NUM_TICKS)
    bottom = _TOP_PX + rows
    for axis, length_px in enumerate((columns, rows)):
        low = float(canvas.low_m[axis])
        first, last = math.ceil(low / step_m), math.floor((low + length_px / canvas.px_per_m) / step_m)
        for k in range(first, last + 1):
            away, text = round((k * step_m - low) * canvas.px_per_m), f"{k * step_m:g}"
            x, y = (_LEFT_PX + away, bottom) if axis == 0 else (_LEFT_PX - 1 - _TICK_PX, bottom - away)
            end = (x, y + _TICK_PX) if axis == 0 else (x + _TICK_PX, y)
            cv2.line(page, (x, y), end, _INK, 1)
            width = _text_width(text)
            _write(page, text, (x - width // 2, y + 26) if axis == 0 else (x - 8 - width, y + 6))
    _write(page, "x / m", (_LEFT_PX + columns // 2 - 20, bottom + 55))
    aside = np.full((24, 60, 3), 255, dtype=np.uint8)
    _write(aside, "y / m", (4, 17))
    middle = max(_TOP_PX + rows // 2 - 30, 0)
    page[middle : middle + 60, 4:28] = cv2.rotate(aside, cv2.ROTATE_90_COUNTERCLOCKWISE)


def _round_step(least: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is no smaller."""
    power = 10.0 ** math.floor(math.log10(least))
    return power * next(k for k in (1, 2, 5, 10) if k * power >= least * (1.0 - 1e-9))


def _write(page: npt.NDArray[np.uint8], text: str, corner: tuple[int, int]) -> None:
    cv2.putText(page, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.55, _INK, 1, cv2.LINE_AA)


def _text_width(text: str) -> int:
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.55, 1)[0][0])
