"""Panels of a picture: an image with its title and scale, or a matrix of words; SVG written by hand.

A report shows dozens of them, and a drawing library takes a second for each.
"""

import base64
from collections.abc import Sequence
from html import escape

import numpy as np
import numpy.typing as npt

from bench.reports.png import PaletteImage, encode_png
from bench.reports.svg import FONT, INK, Svg

WIDTH_PX = 320.0
"""Width of a panel."""
_TITLE_PX, _FOOT_PX, _LETTERS_PX = 24.0, 22.0, 34.0
_SCALE_M = 5.0


def draw_image(title: str, image: PaletteImage, cell_m: float) -> Svg:
    """An image below its title, with a bar of 5 m.

    Args:
        title: What it shows.
        image: What lies below it.
        cell_m: Side of a pixel, metres.
    """
    rows, cols = image.cells.shape
    height, bar = WIDTH_PX * rows / cols, _SCALE_M / cell_m * WIDTH_PX / cols
    floor = _TITLE_PX + height + 12.0
    data = base64.b64encode(encode_png(image)).decode("ascii")
    place = f'x="0" y="{_TITLE_PX:g}" width="{WIDTH_PX:g}" height="{height:g}"'
    body = [
        _write_text(title, (WIDTH_PX / 2.0, 15.0), 13),
        f'<image {place} href="data:image/png;base64,{data}"/>',
        f'<path d="M1 {floor:g}h{bar:g}" stroke="{INK}" stroke-width="2"/>',
        _write_text(f"{_SCALE_M:g} m", (bar + 7.0, floor + 4.0), 11, "start"),
    ]
    return Svg("".join(body), WIDTH_PX, _TITLE_PX + height + _FOOT_PX)


def draw_matrix(
    title: str, names: Sequence[str], colours: npt.NDArray[np.object_], words: npt.NDArray[np.object_]
) -> Svg:
    """A square matrix of coloured cells with a word in each, its rows and columns named.

    Args:
        title: What it shows.
        names: N names.
        colours: (N, N) colours as SVG says them; ``none`` is empty.
        words: (N, N) what stands in the cells.
    """
    side = (WIDTH_PX - _LETTERS_PX) / len(names)
    size, foot = min(11.0, 0.45 * side), _TITLE_PX + len(names) * side + 13.0
    body = [_write_text(title, ((WIDTH_PX + _LETTERS_PX) / 2.0, 15.0), 13)]
    for i, name in enumerate(names):
        middle = (i + 0.5) * side
        left, below = (_LETTERS_PX - 5.0, _TITLE_PX + middle + 4.0), (_LETTERS_PX + middle, foot)
        body.append(_write_text(name, left, min(11.0, side), "end"))
        body.append(_write_text(name, below, min(11.0, 0.6 * side)))
        for j in range(len(names)):
            x, y = _LETTERS_PX + j * side, _TITLE_PX + i * side
            body.append(
                f'<rect x="{x:.2f}" y="{y:.2f}" width="{side:.2f}" height="{side:.2f}" fill="{colours[i, j]}" '
                'stroke="#8888884d" stroke-width=".5"/>'
            )
            if words[i, j]:
                ink = INK if colours[i, j] == "none" else "#101820"
                body.append(_write_text(words[i, j], (x + side / 2.0, y + side / 2.0 + 0.36 * size), size, ink=ink))
    return Svg("".join(body), WIDTH_PX, _TITLE_PX + len(names) * side + _FOOT_PX)


def _write_text(text: str, at: tuple[float, float], size: float, anchor: str = "middle", ink: str = INK) -> str:
    place = f'x="{at[0]:.2f}" y="{at[1]:.2f}" text-anchor="{anchor}"'
    return f'<text {place} {FONT} font-size="{size:g}" fill="{ink}">{escape(text)}</text>'
