"""What an experiment leaves behind: scores, figures, report, and the text for the terminal."""

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import yaml

from bench import code_version
from bench.reports.chapters import make_chapters
from bench.reports.report import Report, write_report
from bench.reports.tables import Results, format_table, gather, records_of, write_results
from bench.settings import BenchSettings
from bench.stages import ScoredCell
from bench.store import write_text
from sim.config import to_plain_dict


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
    settings, results = experiment.settings, gather(experiment.cells)
    write_results(out, results)
    write_text(out / "config.yaml", yaml.safe_dump(_config_document(experiment), sort_keys=False))
    main_table, points, chapters = make_chapters(settings, results, experiment.cells, out / "figures")
    provenance = code_version.provenance() | {"seeds": _tell_seeds({scored.cell.seed for scored in experiment.cells})}
    write_report(out / "report.html", Report(settings.title, experiment.command, tuple(chapters), provenance))
    body = [format_table(main_table), *([""] if points else []), *points, *_complaints(results)]
    return "\n".join([settings.title, "", *body, "", f"{out}/report.html"])


def _tell_seeds(seeds: set[int]) -> str:
    """The seeds of all jobs of a sweep, which need not be those of the first."""
    told = sorted(seeds)
    if len(told) > 1 and told[-1] - told[0] == len(told) - 1:
        return f"{told[0]} to {told[-1]}"
    return ", ".join(map(str, told))


def _complaints(results: Results) -> list[str]:
    """What ended runs without an answer, each said once."""
    bad = records_of(results.scores[results.scores["status"] != "ok"])
    counts = Counter((r["status"], r["dataset"], r["method"], r["reason"]) for r in bad)
    return [f"{status} ({n} x): {where}, {who}: {why}" for (status, where, who, why), n in counts.items()]


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
