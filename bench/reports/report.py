"""One HTML file that needs nothing else: tables, pictures, provenance; light and dark, desktop and phone."""

from dataclasses import dataclass
from pathlib import Path

import jinja2
import pandas as pd

from bench.reports.drawing import Picture
from bench.reports.tables import format_value
from bench.store import write_text

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
    html = environment.get_template("report.html.j2").render(report=report, sections=[_plain(s) for s in sections])
    write_text(path, html)


def _plain(section: Section) -> dict[str, object]:
    """A section as the template wants it: cells as text, with their alignment and marks."""
    table = pd.DataFrame() if section.table is None else section.table
    names = [str(name) for name in table.columns]
    numeric = [pd.api.types.is_numeric_dtype(table[name]) for name in names]
    best = set(section.best)
    rows = [
        [
            {"text": format_value(value), "numeric": n, "best": (k, name) in best}
            for value, n, name in zip(row, numeric, names, strict=True)
        ]
        for k, row in enumerate(table.itertuples(index=False))
    ]
    return {
        "title": section.title,
        "slug": "-".join(section.title.lower().split()),
        "text": section.text,
        "pictures": section.pictures,
        "columns": [{"text": name, "numeric": n} for name, n in zip(names, numeric, strict=True)],
        "key": names.index("method") if "method" in names else 0,
        "rows": rows,
        "points": section.points,
    }
