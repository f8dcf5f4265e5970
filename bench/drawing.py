"""How every picture looks: one set of colours, one hand, saved as SVG, PNG and the data behind it."""

import io
import re
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
from matplotlib.figure import Figure

from bench.store import write_bytes, write_text

METHOD_COLOURS = {"paper": "#2f7ed8", "robust": "#18a058", "sequential": "#e0792b", "external": "#a05bd0"}
"""Colours of the methods, the same in every picture."""
OTHER_COLOURS = ("#c2459a", "#8c8c00", "#00a0a8", "#b0603a", "#6a6ad8", "#7f7f7f")
"""Colours of methods that have none of their own, in their order."""
PAIR_COLOURS = {"tree": "#d1495b", "reliable": "#f2b134", "rejected": "#7f8794", "no_match": "#00000000"}
"""Colours of relative motions: in the tree, confirmed, rejected, none."""
RIGHT_COLOUR = "#18a058"
"""What is right."""
WRONG_COLOUR = "#d1495b"
"""What is wrong."""
_INK = "#12345a"
"""Stands for the colour of text until the SVG is read: it becomes ``currentColor``, light or dark as the page is."""


@dataclass(frozen=True)
class Picture:
    """A finished figure."""

    name: str
    """Stem of its files."""
    title: str
    """Heading."""
    alt: str
    """What it shows, for who cannot see it."""
    svg: str
    """Markup that takes the page's text colour."""


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
    with matplotlib.rc_context(settings | dict.fromkeys(ink, _INK) | {"grid.color": "#8888884d"}):
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size in inches, laid out without overlaps; call within `style`."""
    return Figure(figsize=(width, height), layout="constrained")


@dataclass(frozen=True)
class Label:
    """What a figure is called."""

    name: str
    """Stem of its files."""
    title: str
    """Heading."""
    alt: str
    """What it shows, in a sentence."""


def save_picture(figure: Figure, folder: Path, label: Label, data: pd.DataFrame) -> Picture:
    """Write ``NAME.svg``, ``NAME.png`` and ``NAME.csv``, and give the SVG for a page.

    Args:
        figure: What was drawn within `style`.
        folder: Where the files go.
        label: Their stem, and what the page says about it.
        data: The numbers behind it.
    """
    with style(), matplotlib.rc_context({"svg.hashsalt": label.name}):
        text, image = io.StringIO(), io.BytesIO()
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once, for both files
        figure.savefig(text, format="svg", metadata={"Date": None})
        figure.savefig(image, format="png", dpi=120, facecolor="white")
    svg = text.getvalue()
    write_text(folder / f"{label.name}.svg", svg.replace(_INK, "#222222"))
    write_bytes(folder / f"{label.name}.png", image.getvalue())
    write_text(folder / f"{label.name}.csv", data.to_csv(index=False))
    return Picture(label.name, label.title, label.alt, _inline(svg, label.name, label.alt))


def _inline(svg: str, name: str, alt: str) -> str:
    """The SVG element for a page: no prologue, own ids, scalable, the page's ink, a spoken label."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", body))
    ids = set(re.findall(r'\bid="([^"]+)"', body))
    for found in ids:
        own = f"{name}-{found}"
        body = body.replace(f'id="{found}"', f'id="{own}"').replace(f"#{found})", f"#{own})")
        body = body.replace(f'href="#{found}"', f'href="#{own}"')
    label = alt.replace("&", "and").replace('"', "'").replace("<", "under ").replace(">", "over ")
    return body.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1).replace(_INK, "currentColor")
