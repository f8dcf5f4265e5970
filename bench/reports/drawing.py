"""How every picture looks: one set of colours, one hand, saved as SVG and the data behind it."""

import io
import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from bench.reports.svg import INK, Entry, Legend, Svg, parse_svg, scope_ids, write_file, write_inline
from bench.store import write_text


@dataclass(frozen=True)
class Hand:
    """How a method is drawn: by colour and by shape, for who cannot tell the colours apart."""

    colour: str
    """As SVG says it; the colours of our own methods stay apart for the colour-blind, on white and on black."""
    marker: str
    """As matplotlib names it."""
    mark: str
    """The same as a letter."""


METHOD_HANDS = {
    "paper": Hand("#3b82f6", "o", "●"),
    "robust": Hand("#0c8f6b", "s", "■"),
    "sequential": Hand("#e8820c", "^", "▲"),
    "external": Hand("#a8489e", "D", "◆"),
}
"""Our methods, the same in every picture."""
OTHER_COLOURS = ("#c2459a", "#8c8c00", "#00a0a8", "#b0603a", "#6a6ad8", "#7f7f7f")
"""Colours of methods that are none of ours, in their order."""
OTHER_MARKS = (("v", "▼"), ("<", "◀"), (">", "▶"), ("o", "●"), ("s", "■"), ("D", "◆"), ("^", "▲"))
"""Their shapes: one more, so that a colour that comes again has another shape."""
PAIR_COLOURS = {"tree": "#bf3650", "reliable": "#f2b134", "rejected": "#9aa3b0", "no_match": "none"}
"""Colours of relative motions: in the tree, confirmed, rejected, none."""
MOST_MAP_COLOURS = 250
"""Colours of maps; with more maps they come again."""
_MOST_DECADES = 6
"""Labels that a logarithmic axis has room for."""
CURVE_SIZE_IN = (4.8, 3.6)
"""Width and height of a panel with curves."""


@dataclass(frozen=True)
class Label:
    """What a picture is called."""

    name: str
    """Stem of its files."""
    title: str
    """Heading."""
    alt: str
    """What it shows, in a sentence, for who cannot see it."""


@dataclass(frozen=True)
class Picture:
    """A finished picture."""

    label: Label
    """What it is called."""
    panels: tuple[str, ...]
    """Elements ``<svg>`` that take the page's text colour and may stand side by side."""
    legend: tuple[Entry, ...]
    """What its colours and marks stand for."""


def method_hands(methods: Iterable[object]) -> dict[str, Hand]:
    """How each method is drawn, each once, in their order; a method keeps its hand whoever is beside it."""
    names = list(dict.fromkeys(map(str, methods)))
    others = [name for name in names if name not in METHOD_HANDS]
    drawn = zip(others, itertools.cycle(OTHER_COLOURS), itertools.cycle(OTHER_MARKS), strict=False)
    hands = METHOD_HANDS | {name: Hand(colour, *marks) for name, colour, marks in drawn}
    return {name: hands[name] for name in names}


def method_legend(methods: Iterable[object]) -> list[Entry]:
    """The legend of a picture of these methods."""
    return [Entry(name, hand.colour, hand.mark) for name, hand in method_hands(methods).items()]


def map_colours(count: int) -> npt.NDArray[np.float64]:
    """(count, 3) colours for maps, the first `MOST_MAP_COLOURS` distinct, legible on white and on black."""
    if count <= 10:
        base = colormaps["tab10"](np.arange(count) % 10)[:, :3]
    else:
        hues = (np.arange(count) % MOST_MAP_COLOURS * 0.61803398875) % 1.0
        base = colormaps["hsv"](hues)[:, :3] * 0.85
    return np.asarray(0.12 + 0.8 * base, dtype=np.float64)


@contextmanager
def style() -> Iterator[None]:
    """The look of all figures: no background, the page's ink, sans-serif text that stays text."""
    settings: Any = {
        "svg.fonttype": "none",
        "text.parse_math": False,
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 10.0,
        "axes.titlesize": 11.0,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.axisbelow": True,
        "legend.frameon": False,
        "figure.facecolor": "none",
        "axes.facecolor": "none",
        "savefig.facecolor": "none",
    }
    ink = ("text.color", "axes.edgecolor", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color")
    with matplotlib.rc_context(settings | dict.fromkeys(ink, INK) | {"grid.color": "#8888884d"}):
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size in inches, laid out without overlaps; call within `style`."""
    return Figure(figsize=(width, height), layout="constrained")


def set_plain_decades(axis: Axes) -> None:
    """Label the decades of a logarithmic x axis by plain numbers: powers of ten take long to be set."""
    axis.xaxis.set_major_locator(LogLocator(numticks=_MOST_DECADES))
    axis.xaxis.set_major_formatter(lambda value, _position: f"{value:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())


def render(figure: Figure, name: str) -> Svg:
    """A figure that was drawn within `style`; a name that no other figure of a page has keeps its ids apart."""
    with style(), matplotlib.rc_context({"svg.hashsalt": name}):
        text = io.StringIO()
        layout = figure.get_layout_engine()
        if layout is not None:
            layout.execute(figure)
        figure.set_layout_engine("none")
        canvas: Any = FigureCanvasSVG(figure)
        canvas.print_svg(text, metadata={"Date": None})  # savefig would draw everything twice
    return scope_ids(parse_svg(text.getvalue()), name)


def save_picture(panels: Sequence[Svg], legend: Legend, folder: Path, label: Label, data: pd.DataFrame) -> Picture:
    """Write ``NAME.svg`` and ``NAME.csv``, and give the picture for a page.

    Args:
        panels: What was drawn, side by side.
        legend: What their colours and marks stand for.
        folder: Where the files go.
        label: Their stem, and what the page says about it.
        data: The numbers behind it.
    """
    write_text(folder / f"{label.name}.svg", write_file(panels, legend))
    write_text(folder / f"{label.name}.csv", data.to_csv(index=False))
    return Picture(label, tuple(map(write_inline, panels)), tuple(legend))
