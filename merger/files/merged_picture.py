"""A picture of a merge for people: each map's walls in its own colour, with its name."""

import colorsys

import cv2
import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from merger.result import MapPlacement

_LONGEST_PX = 1400
_LEGEND_PX = 260
_LINE_PX = 26
_MARGIN_PX = 20
_WHITE, _FREE, _TEXT, _LEFT_OUT = (255, 255, 255), (238, 238, 238), (40, 40, 40), (150, 150, 150)
_Image = npt.NDArray[np.uint8]


def draw_merge(merged: GridMap, maps: list[GridMap], placements: tuple[MapPlacement, ...], reference: str) -> _Image:
    """Draw the maps of the largest component where they lie, y upwards, and a legend of all maps.

    Args:
        merged: The merged map; its free space is the background, its frame the picture's.
        maps: The maps, in the order of the placements.
        placements: Where they lie.
        reference: Name of the reference map.

    Returns:
        (H, W, 3) picture, blue, green, red.
    """
    rows, cols = merged.log_odds.shape
    scale = min(4.0, _LONGEST_PX / max(rows, cols))
    size = (max(1, round(cols * scale)), max(1, round(rows * scale)))
    free = cv2.resize(merged.free.astype(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
    image = np.full((*free.shape, 3), 255, dtype=np.uint8)
    image[free] = _FREE
    colours = make_colours(len(maps))
    labels = []
    for grid, placement, colour in zip(maps, placements, colours, strict=True):
        if placement.component == 0:
            pixels = _to_pixels(merged, grid, placement, scale)
            _paint(image, pixels, colour, max(2, round(scale * grid.resolution_m / merged.resolution_m)))
            if len(pixels):
                labels.append((placement.name, np.median(pixels, axis=0), colour))
    image = np.ascontiguousarray(image[::-1])
    for name, (x, y), colour in labels:
        _write(image, name, (int(x) - 5 * len(name), len(image) - int(y)), colour)
    return _add_legend(image, placements, colours, reference)


def make_colours(count: int) -> list[tuple[int, int, int]]:
    """Distinct dark colours, blue, green, red: hues a golden section apart, in three shades."""
    colours = []
    for index in range(count):
        hue, value = (0.58 + index * 0.618034) % 1.0, (0.80, 0.62, 0.92)[index % 3]
        red, green, blue = colorsys.hsv_to_rgb(hue, 0.85, value)
        colours.append((round(255 * blue), round(255 * green), round(255 * red)))
    return colours


def _to_pixels(merged: GridMap, grid: GridMap, placement: MapPlacement, scale: float) -> npt.NDArray[np.intp]:
    """(N, 2) x and y, upwards, of the map's occupied cells in the picture."""
    T_ref_map = np.eye(3) if placement.T_ref_map is None else placement.T_ref_map
    points_map = grid.cell_centers(grid.occupied) * (placement.scale or 1.0)
    points_ref = se2.transform_points(T_ref_map, points_map)
    return np.asarray(np.floor(merged.cells_from_points_map(points_ref)[:, ::-1] * scale).astype(np.intp))


def _paint(image: _Image, pixels: npt.NDArray[np.intp], colour: tuple[int, int, int], side: int) -> None:
    rows, cols = image.shape[:2]
    for dy in range(side):
        for dx in range(side):
            x, y = pixels[:, 0] + dx, pixels[:, 1] + dy
            inside = (x >= 0) & (x < cols) & (y >= 0) & (y < rows)
            image[y[inside], x[inside]] = colour


def _add_legend(
    image: _Image, placements: tuple[MapPlacement, ...], colours: list[tuple[int, int, int]], reference: str
) -> _Image:
    """Margins all round, and the names at the right."""
    height = max(len(image), _LINE_PX * len(placements)) + 2 * _MARGIN_PX
    page = np.full((height, image.shape[1] + 2 * _MARGIN_PX + _LEGEND_PX, 3), 255, dtype=np.uint8)
    page[_MARGIN_PX : _MARGIN_PX + len(image), _MARGIN_PX : _MARGIN_PX + image.shape[1]] = image
    x = image.shape[1] + 2 * _MARGIN_PX
    for line, (placement, colour) in enumerate(zip(placements, colours, strict=True)):
        y = _MARGIN_PX + _LINE_PX * line
        shown = placement.component == 0
        cv2.rectangle(page, (x, y), (x + 16, y + 16), colour if shown else _LEFT_OUT, cv2.FILLED)
        note = " (reference)" if placement.name == reference else ""
        note = note if shown else " (other component)" if placement.placed else " (left out)"
        _write(page, placement.name + note, (x + 24, y + 14), _TEXT if shown else _LEFT_OUT)
    return page


def _write(image: _Image, text: str, corner: tuple[int, int], colour: tuple[int, int, int]) -> None:
    for ink, thickness in ((_WHITE, 4), (colour, 1)):
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, thickness, cv2.LINE_AA)
