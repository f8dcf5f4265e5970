"""What an experiment leaves behind: scores, figures, report, and the text for the terminal."""

from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd
import yaml

from bench import code_version, figures
from bench.drawing import Picture
from bench.exhibit import Exhibit, first_of_each, load_exhibit
from bench.report import Report, Section, write_report
from bench.settings import BenchSettings
from bench.stages import ScoredCell
from bench.store import write_text
from bench.tables import Results, format_table, gather, summarize, write_results
from sim.config import to_plain_dict

MAX_EXHIBITS = 12
"""Results that are drawn, so that a sweep of thousands still gives a report that one can open."""
_SHORT = {
    "dataset": "dataset",
    "method": "method",
    "runs": "runs",
    "success": "success",
    "num_maps": "maps",
    "num_placed": "placed",
    "num_wrong": "wrong",
    "max_error_m": "worst m",
    "median_error_m": "median m",
    "objective_initial": "Obj. coarse",
    "objective": "Obj. fine",
    "objective_floor": "Obj. floor",
    "runtime_s": "T(s)",
}


@dataclass(frozen=True)
class Experiment:
    """A finished experiment."""

    name: str
    """Its name."""
    settings: BenchSettings
    """What was asked for."""
    cells: tuple[ScoredCell, ...]
    """What was found."""
    command: str
    """The command that makes it again."""


def write_experiment(experiment: Experiment, out: Path) -> str:
    """Write scores, figures, report and configuration into ``out``.

    Returns:
        The table, and what went wrong, for the terminal.
    """
    results = gather(experiment.cells)
    write_results(out, results)
    write_text(out / "config.yaml", yaml.safe_dump(_config_document(experiment), sort_keys=False))
    summary = short_summary(results)
    exhibits = [e for e in map(load_exhibit, first_of_each(experiment.cells)[:MAX_EXHIBITS]) if e]
    sections = [Section("Summary", _notes(results), table=summary), *_picture_sections(exhibits, out / "figures")]
    write_report(
        out / "report.html",
        Report(experiment.settings.title, experiment.command, tuple(sections), code_version.provenance()),
    )
    lines = [experiment.settings.title, "", format_table(summary), *_complaints(results), "", f"{out}/report.html"]
    return "\n".join(lines)


def short_summary(results: Results) -> pd.DataFrame:
    """The table that is printed: one row a dataset, swept point and method."""
    table = summarize(results, ["dataset", *results.swept, "method"])
    columns = ["dataset", *results.swept, *(c for c in _SHORT if c != "dataset")]
    return table[columns].rename(columns=_SHORT)


def _picture_sections(exhibits: list[Exhibit], folder: Path) -> list[Section]:
    merged: list[Picture] = []
    pairs: list[Picture] = []
    for exhibit in exhibits:
        merged.append(figures.draw_coarse_fine(exhibit, folder))
        if exhibit.prediction.pairs:
            pairs.append(figures.draw_pairs(exhibit, folder))
            unreliable = figures.draw_unreliable_pair(exhibit, folder)
            pairs += [unreliable] if unreliable else []
    return [
        Section(
            "Merged maps",
            "Each map has its own colour; where walls of two colours lie on each other, maps agree.",
            tuple(merged),
        ),
        Section("Pairs", "A cross marks a motion that the truth contradicts.", tuple(pairs)),
    ]


def _notes(results: Results) -> str:
    wrong = int(results.scores["num_wrong"].sum())
    total = int(results.scores["num_maps"].sum())
    return (
        f"{len(results.scores)} runs with {total} maps; {wrong} placed wrong, that is more than 0.5 m or 2° from where "
        "they belong. Obj. is in cells²; its floor is its value under the true motions."
    )


def _complaints(results: Results) -> list[str]:
    bad = results.scores[results.scores["status"] != "ok"]
    return [
        f"{row.status}: {row.dataset} x {row.method}, seed {row.seed}: {row.reason}"
        for row in bad.itertuples(index=False)
    ]


def _config_document(experiment: Experiment) -> dict[str, object]:
    datasets: dict[str, object] = {}
    for scored in experiment.cells:
        spec = scored.cell.dataset
        name = " ".join([spec.label, *(f"{key}={value}" for key, value in spec.swept)])
        datasets.setdefault(name, to_plain_dict(spec.config))
    return {
        "experiment": experiment.name,
        "command": experiment.command,
        "settings": asdict(experiment.settings),
        "datasets": datasets,
    }
