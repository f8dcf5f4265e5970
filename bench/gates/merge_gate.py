"""The gate for a test suite of one's own: run a merger, score it, compare it with a baseline.

This is what the pytest fixture ``merge_gate`` calls (see `bench.pytest_plugin`).
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from bench.cell import Outcome
from bench.gates.baseline import read_baseline, write_baseline
from bench.gates.comparison import Comparison, compare_rows
from bench.gates.rows import GateRow, make_row, read_rows
from bench.gates.tolerances import COSTS, change_tolerances
from bench.mergers import external
from bench.mergers.fork_server import Failed, Skipped
from bench.mergers.merger_call import Merger, merger_command
from bench.mergers.reference_workload import time_reference
from bench.mergers.workspace import make_workspace
from bench.scoring.result_document import PredictionError
from bench.scoring.result_reader import read_prediction
from bench.scoring.score_rows import Score
from bench.scoring.scores import score_failure, score_result
from bench.scoring.yardstick import make_yardstick
from sim.datasets.dataset import read_dataset


@dataclass(frozen=True)
class MergeGateConfig:
    """What is run, and what it is compared with.

    Raises:
        ValueError: not exactly one of ``command`` and ``merger`` is given, or nothing to run it on.
    """

    baseline: Path
    """The baseline's JSON file."""
    command: str | None = None
    """The merger as ``prog {maps} {out}``."""
    merger: Merger | None = None
    """The merger as a function, see `bench.mergers.merger_call`."""
    datasets: tuple[Path, ...] = ()
    """Dataset folders that ``python -m sim`` made."""
    overrides: tuple[str, ...] = ()
    """What follows ``python -m bench``: ``experiment=overlap seeds=5``, ``world=tim submaps.count=6`` and so on."""
    tolerances: Mapping[str, float] = field(default_factory=dict)
    """Absolute tolerances in place of the gate's own, by score."""
    costs: bool = False
    """Whether time and memory are judged, too: for machines that do nothing else meanwhile."""
    name: str = "merger"
    """Name of the method in the baseline."""

    def __post_init__(self) -> None:
        """Refuse what cannot be run."""
        if (self.command is None) == (self.merger is None):
            raise ValueError("merge_gate needs either command='prog {maps} {out}' or merger=function")
        if not self.datasets and not self.overrides:
            raise ValueError("merge_gate needs datasets=[folder, ...] or overrides=['experiment=...', ...]")

    @property
    def full_command(self) -> str:
        """The merger as a command."""
        command = merger_command(self.merger) if self.merger is not None else str(self.command)
        external.check_command(command)
        return command


def run_merge_gate(config: MergeGateConfig, folder: Path, *, update: bool = False) -> Comparison:
    """Run the merger and compare it with the baseline.

    Args:
        config: What is run.
        folder: An empty folder for results.
        update: Whether what comes out becomes the baseline.

    Raises:
        ValueError: a dataset, a key or the baseline cannot be used, or what failed was to become the baseline.
    """
    rows = [score_on_dataset(config, dataset, folder) for dataset in config.datasets]
    if config.overrides:
        rows += _run_bench(config, folder / "bench")
    if update:
        _refuse_failures(rows)
        write_baseline(config.baseline, rows, costs=config.costs)
    tolerances = [t for t in change_tolerances(config.tolerances) if config.costs or t.score not in COSTS]
    return compare_rows(read_baseline(config.baseline), rows, tolerances)


def score_on_dataset(config: MergeGateConfig, folder: Path, work: Path) -> GateRow:
    """Run the merger on one dataset folder and score it; a failure is a row with its reason."""
    dataset, out = read_dataset(folder), work / folder.name
    out.mkdir(parents=True)
    try:
        with make_workspace(out) as place:
            fields = external.call_command(config.full_command, sorted((folder / "maps").glob("*.yaml")), place)
        outcome = Outcome("ok", reference_s=time_reference(), **fields)
        answer = read_prediction(out / "result.json", dataset.truth.names)
        score, _, _ = score_result(make_yardstick(dataset), answer, outcome)
    except (Skipped, Failed, PredictionError) as error:
        status = "skipped" if isinstance(error, Skipped) else "failed"
        score = score_failure(len(dataset.maps), Outcome(status, str(error)))
    seed = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))["seed"]
    return make_row({"dataset": folder.name, "method": config.name, "seed": seed}, *_row_fields(score))


def _refuse_failures(rows: Sequence[GateRow]) -> None:
    for row in rows:
        if row.status != "ok":
            raise ValueError(f"no baseline from a run that {row.status}: {row.label}, seed {row.seed}: {row.reason}")


def _row_fields(score: Score) -> tuple[str, str | None, dict[str, float]]:
    numbers = {key: float(value) for key, value in asdict(score).items() if isinstance(value, (bool, int, float))}
    return score.status, score.reason, numbers


def _run_bench(config: MergeGateConfig, out: Path) -> Sequence[GateRow]:
    """Run the bench in a process of its own and read its scores."""
    quoted = config.full_command.replace("\\", "\\\\").replace("'", "\\'")
    method = ["method=external", f"method.name={config.name}", f"method.command='{quoted}'"]
    command = [sys.executable, "-m", "bench", *method, f"out='{out}'", "quiet=true", *config.overrides]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode not in (0, 1):  # 1: not one row is ok, and each says why
        raise ValueError(done.stderr.strip() or f"the bench ended with status {done.returncode}")
    return read_rows(out / "scores.csv")
