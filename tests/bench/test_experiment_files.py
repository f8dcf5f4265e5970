"""Every experiment under ``conf/``: all of it is composed, and a small piece of it is run."""

import dataclasses
from pathlib import Path

import pandas as pd
import pytest
from omegaconf import OmegaConf

from bench.command import compose_sim
from bench.experiment import Experiment, write_experiment
from bench.plan import plan_cells
from bench.reports import chapters, picture_chapters
from bench.run import RunOptions, run_cells
from bench.settings import BenchSettings, DatasetSettings, read_settings
from bench.store import Store
from sim.hydra_schema import compose_config, register
from sim.resources import conf_folder
from sim.sim_schema import register_schema

NAMES = sorted(path.stem for path in (conf_folder() / "experiment").glob("*.yaml"))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("store"))


def settings_of(name: str, *overrides: str) -> BenchSettings:
    register("bench_schema", BenchSettings)
    register_schema()
    node = compose_config(conf_folder(), "bench", [f"experiment={name}", *overrides])
    return read_settings(OmegaConf.to_container(node, resolve=True))  # type: ignore[arg-type]  # a mapping of words


def test_there_are_experiments() -> None:
    assert {"quick", "table1", "table2", "ablation", "overlap", "noise", "num_maps", "resolution"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_the_ends_of_an_experiment_can_be_planned(name: str, log_folder: Path) -> None:
    settings = settings_of(name, f"logs={log_folder}")
    ends = {key: [values[0], values[-1]] for key, values in settings.sweep.items()}
    settings = dataclasses.replace(settings, seeds=1, sweep=ends)
    cells = plan_cells(settings, [], compose_sim)
    assert cells
    assert settings.title != settings_of("one").title or name == "one"


@pytest.mark.parametrize("name", NAMES)
def test_a_small_piece_of_an_experiment_runs(
    name: str, log_folder: Path, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chapters, "MAX_EXHIBITS", 2 if name == "table1" else 0)
    monkeypatch.setattr(picture_chapters, "MAX_FAILURES", 0)
    settings = settings_of(name, f"logs={log_folder}")
    small = dataclasses.replace(
        settings,
        datasets={"tiny": DatasetSettings(["submaps.count=4"], "tiny")},
        all_logs=False,
        sweep={},
        methods=settings.methods[:2],
        seeds=1,
        orders=min(settings.orders, 2),
        method_workers=1,
    )
    cells = run_cells(plan_cells(small, [], compose_sim), store, RunOptions())
    text = write_experiment(Experiment(name, small, tuple(cells), "python -m bench"), tmp_path)
    assert settings.title in text
    assert len(pd.read_csv(tmp_path / "scores.csv")) == len(cells)
    assert settings.title.replace("'", "&#39;") in (tmp_path / "report.html").read_text()
