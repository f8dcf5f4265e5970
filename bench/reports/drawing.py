"""How every picture looks: one set of colours, one hand, saved as SVG and the data behind it."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib import colormaps
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from bench.reports.svg import INK, Legend, Svg, parse_svg, scope_ids, write_file, write_inline
from bench.store import write_text

METHOD_COLOURS = {"paper": "#2f7ed8", "robust": "#18a058", "sequential": "#e0792b", "external": "#a05bd0"}
"""Colours of the methods, the same in every picture."""
OTHER_COLOURS = ("#c2459a", "#8c8c00", "#00a0a8", "#b0603a", "#6a6ad8", "#7f7f7f")
"""Colours of methods that have none of their own, in their order."""
PAIR_COLOURS = {"tree": "#d1495b", "reliable": "#f2b134", "rejected": "#7f8794", "no_match": "none"}
"""Colours of relative motions: in the tree, confirmed, rejected, none."""
CURVE_SIZE_IN = (5.4, 3.9)
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
    legend: tuple[tuple[str, str], ...]
    """Words and the colour that each stands for."""


def method_colours(methods: Sequence[str]) -> dict[str, str]:
    """A colour for every method."""
    others = [m for m in methods if m not in METHOD_COLOURS]
    return METHOD_COLOURS | {m: OTHER_COLOURS[k % len(OTHER_COLOURS)] for k, m in enumerate(others)}


def map_colours(count: int) -> npt.NDArray[np.float64]:
    """(count, 3) distinct colours for maps, legible on white and on black."""
    if count <= 10:
        base = colormaps["tab10"](np.arange(count) % 10)[:, :3]
    else:
        hues = (np.arange(count) * 0.61803398875) % 1.0
        base = colormaps["hsv"](hues)[:, :3] * 0.85
    return np.asarray(0.12 + 0.8 * base, dtype=np.float64)


@contextmanager
def style() -> Iterator[None]:
    """The look of all figures: no background, the page's ink, sans-serif text that stays text."""
    settings: Any = {
        "svg.fonttype": "none",
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
        legend: Words and the colour that each stands for.
        folder: Where the files go.
        label: Their stem, and what the page says about it.
        data: The numbers behind it.
    """
    write_text(folder / f"{label.name}.svg", write_file(panels, legend))
    write_text(folder / f"{label.name}.csv", data.to_csv(index=False))
    return Picture(label, tuple(write_inline(panel, label.alt) for panel in panels), tuple(legend))
