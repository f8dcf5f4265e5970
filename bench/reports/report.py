"""One HTML file that needs nothing else: tables, pictures, provenance; light and dark, desktop and phone."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import jinja2
import pandas as pd

from bench.reports.drawing import Picture
from bench.reports.tables import format_value
from bench.store import write_text

MAX_ROWS = 12
"""A longer table is folded; where a sweep has one, one row a method stands in its place."""
_LONG = 40
"""Letters of a cell from which its column is set in lines."""
_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Section:
    """A chapter of the report."""

    title: str
    """Heading."""
    text: str = ""
    """What to see here, in plain sentences."""
    pictures: tuple[Picture, ...] = ()
    """Figures, in order."""
    table: pd.DataFrame | None = None
    """A table above the figures."""
    best: tuple[tuple[int, str], ...] = ()
    """Row and column of the table's best values."""
    points: tuple[str, ...] = ()
    """Sentences below the table; those that say DISAGREES are marked."""
    folded: bool = False
    """Whether the table is folded behind a line that says what it is."""
    num_open: int | None = None
    """How many figures are open, the others folded behind their titles; none: all are open, and cannot be folded."""


@dataclass(frozen=True)
class Report:
    """The whole report."""

    title: str
    """Heading of the page."""
    command: str
    """The command that makes it again."""
    sections: tuple[Section, ...]
    """Chapters; those without content are left out."""
    provenance: dict[str, str]
    """Versions, revision and machine."""


def write_report(path: Path, report: Report) -> None:
    """Write the report as one self-contained HTML file, whole or not at all."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    sections = [s for s in report.sections if s.table is not None or s.pictures]
    first = itertools.accumulate((len(s.pictures) for s in sections), initial=1)
    plain = [_plain(section, number) for section, number in zip(sections, first, strict=False)]
    html = environment.get_template("report.html.j2").render(report=report, sections=plain)
    write_text(path, html)


def _plain(section: Section, first_figure: int) -> dict[str, object]:
    """A section as the template wants it: cells as text, with their alignment and marks; figures with their numbers."""
    table = pd.DataFrame() if section.table is None else section.table
    names = [str(name) for name in table.columns]
    numeric = [pd.api.types.is_numeric_dtype(table[name]) for name in names]
    long = [not n and table[name].astype(str).str.len().max() > _LONG for n, name in zip(numeric, names, strict=True)]
    best = set(section.best)
    rows = [
        [
            {"text": format_value(value), "numeric": n, "long": wraps, "best": (k, name) in best}
            for value, n, wraps, name in zip(row, numeric, long, names, strict=True)
        ]
        for k, row in enumerate(table.itertuples(index=False))
    ]
    return {
        "title": section.title,
        "slug": "-".join(section.title.lower().split()),
        "text": section.text,
        "figures": [
            {"number": first_figure + k, "picture": p, "open": section.num_open is None or k < section.num_open}
            for k, p in enumerate(section.pictures)
        ],
        "folds": section.num_open is not None,
        "folded": section.folded,
        "columns": [{"text": name, "numeric": n} for name, n in zip(names, numeric, strict=True)],
        "key": names.index("method") if "method" in names else 0,
        "rows": rows,
        "points": section.points,
    }
