"""SVG as text: elements that stand side by side in a file, and wrap on a page."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

INK = "#12345a"
"""Stands for the colour of text until the SVG is read: on a page it becomes ``currentColor``, light or dark."""
FONT = 'font-family="DejaVu Sans, sans-serif"'
"""Of every text that is written by hand."""

_FILE_INK = "#222222"
_LARGEST = 1.3
"""Pixels of a page for a pixel of a drawing at most, so that letters have one size, few panels or many."""
_GAP_PX, _ROW_PX, _MARK_PX, _LETTER_PX = 12.0, 18.0, 12.0, 6.6


@dataclass(frozen=True)
class Entry:
    """One word of a legend."""

    word: str
    """What is shown."""
    colour: str
    """How it is shown, as SVG says it."""
    mark: str = "■"
    """The letter that stands in this colour before the word."""


Legend = Sequence[Entry]


@dataclass(frozen=True)
class Svg:
    """One drawing; its text is drawn in `INK`."""

    body: str
    """What is inside the element."""
    width_px: float
    """Width of its view box."""
    height_px: float
    """Height of its view box."""


def parse_svg(text: str) -> Svg:
    """The drawing of an SVG file whose root states a view box that begins at 0, 0."""
    start = text.index("<svg")
    head = text[start : text.index(">", start)]
    found = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', head)
    if found is None:
        raise ValueError("an SVG without a view box")
    return Svg(text[start + len(head) + 1 : text.rindex("</svg>")], float(found[1]), float(found[2]))


def scope_ids(svg: Svg, name: str) -> Svg:
    """The same drawing with ids of its own, so that several can stand on one page."""
    body = svg.body
    for found in set(re.findall(r'\bid="([^"]+)"', body)):
        own = f"{name}-{found}"
        body = body.replace(f'id="{found}"', f'id="{own}"').replace(f"#{found})", f"#{own})")
        body = body.replace(f'href="#{found}"', f'href="#{own}"')
    return Svg(body, svg.width_px, svg.height_px)


def write_inline(svg: Svg) -> str:
    """A drawing as an element of a page: scalable, in the page's ink, silent where the page says what it shows."""
    box = f'viewBox="0 0 {svg.width_px:g} {svg.height_px:g}"'
    body = svg.body.replace(INK, "currentColor")
    size = f'style="max-width:{_LARGEST * svg.width_px:.0f}px"'
    return f'<svg aria-hidden="true" xmlns="http://www.w3.org/2000/svg" {box} {size}>{body}</svg>'


def write_file(svgs: Sequence[Svg], legend: Legend) -> str:
    """Drawings side by side, the legend below them, as a file."""
    width = sum(svg.width_px for svg in svgs) + _GAP_PX * (len(svgs) - 1)
    parts, left = [], 0.0
    for svg in svgs:
        size = f'width="{svg.width_px:g}" height="{svg.height_px:g}"'
        parts.append(f'<svg x="{left:g}" y="0" {size}>{svg.body}</svg>')
        left += svg.width_px + _GAP_PX
    height = max(svg.height_px for svg in svgs)
    rows = _write_legend(legend, width, height)
    height += _ROW_PX * len(rows)
    head = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    size = f'width="{width:g}" height="{height:g}" viewBox="0 0 {width:g} {height:g}"'
    text = "\n".join([f"<svg {head} {size}>", *parts, *rows, "</svg>"])
    return text.replace(INK, _FILE_INK) + "\n"


def _write_legend(legend: Legend, width: float, top: float) -> list[str]:
    """The rows of a legend that wraps at a width."""
    rows: list[list[str]] = []
    left = width
    for entry in legend:
        needed = _MARK_PX + _LETTER_PX * len(entry.word) + _GAP_PX
        if left + needed > width:
            rows.append([])
            left = 0.0
        baseline = top + _ROW_PX * len(rows) - 5.0
        for x, size, colour, text in ((left, 12, entry.colour, entry.mark), (left + _MARK_PX, 11, INK, entry.word)):
            place = f'x="{x:g}" y="{baseline:g}"'
            rows[-1].append(f'<text {place} {FONT} font-size="{size}" fill="{colour}">{escape(text)}</text>')
        left += needed
    return ["".join(row) for row in rows]
