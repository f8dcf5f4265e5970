"""``python -m bench``: from the words of the command line to a finished experiment."""

import importlib
import itertools
import threading
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf
from tqdm import tqdm

from bench.cell import Cell
from bench.cluster import check_launcher, launch_jobs
from bench.out_folder import STORE, claim_folder
from bench.plan import plan_cells
from bench.run import RunOptions, run_cells
from bench.settings import BenchSettings, read_settings
from bench.stages import ScoredCell, keys_of
from bench.store import Store
from sim.config import SimConfig
from sim.hydra_schema import build, compose_config, parse_overrides, register
from sim.resources import conf_folder
from sim.sim_schema import register_schema
from sim.source import check_source

_USAGE = "python -m bench [-m] [experiment=NAME] [key=value ...]: run an experiment, print its table, write its report."
_MULTIRUN = ("-m", "--multirun")
_WHOLE_RUN = ("experiment", "title", "table", "out", "workers", "retry_failed", "quiet")
_OWN_KEYS = {"experiment", *(item.name for item in fields(BenchSettings))}


def run_command(arguments: list[str]) -> str:
    """Run an experiment as its command line says.

    Returns:
        What there is to print: its table, or nothing if it is to be quiet.

    Raises:
        ValueError: a key, a value or a folder cannot be used.
    """
    if "--help" in arguments or "-h" in arguments:
        return _help()
    register("bench_schema", BenchSettings)
    register_schema()
    multirun = any(argument in _MULTIRUN for argument in arguments)
    arguments = [_quote_command(argument) for argument in arguments]
    launcher = [a for a in arguments if _root_key(a) == "hydra" or a.startswith("hydra/")]
    jobs = expand_sweep([a for a in arguments if a not in (*_MULTIRUN, *launcher)], multirun)
    planned = [_plan(job) for job in jobs]
    settings, name = planned[0][0], planned[0][1]
    cells = list({keys_of(cell).score: cell for _, _, job_cells in planned for cell in job_cells}.values())
    if launcher:
        check_launcher(conf_folder(), launcher)
    _check_sources(cells)
    out = Path(settings.out or f"out/{name}")
    claim_folder(out)
    store = Store(out / STORE)
    options = RunOptions(settings.workers, settings.retry_failed)
    if launcher:
        launch_jobs(cells, out, options, conf_folder(), launcher)
    threading.Thread(target=importlib.import_module, args=("bench.experiment",), daemon=True).start()
    with tqdm(total=len(cells), unit="cell", disable=settings.quiet, dynamic_ncols=True) as bar:
        done = run_cells(cells, store, options, lambda cell, _done, _total: _tick(bar, cell))
    from bench.experiment import Experiment, write_experiment  # noqa: PLC0415  # pandas, matplotlib: not before rows run

    text = write_experiment(Experiment(name, settings, tuple(done), _command(arguments)), out)
    return "" if settings.quiet else text


def expand_sweep(overrides: Sequence[str], multirun: bool) -> list[list[str]]:
    """The overrides of every job: ``key=a,b`` gives two, as hydra's own sweeper does it.

    Raises:
        ValueError: a key has several values without ``-m``, or belongs to the run as a whole.
    """
    choices: list[list[str]] = []
    for override in parse_overrides(overrides):
        key = override.get_key_element()
        if override.is_sweep_override():
            if not multirun:
                raise ValueError(f"'{override.input_line}' has several values: sweeps need -m")
            if key in _WHOLE_RUN:
                raise ValueError(f"{key} is a setting of the whole run, and cannot be swept")
            choices.append([f"{key}={value}" for value in override.sweep_string_iterator()])
        else:
            choices.append([str(override.input_line)])
    return [list(job) for job in itertools.product(*choices)]


def _plan(overrides: Sequence[str]) -> tuple[BenchSettings, str, list[Cell]]:
    own = [o for o in overrides if _root_key(o) in _OWN_KEYS]
    foreign = [o for o in overrides if _root_key(o) not in _OWN_KEYS]
    node: Any = OmegaConf.to_container(compose_config(conf_folder(), "bench", own), resolve=True)
    settings = read_settings(node)
    chosen = [o.partition("=")[2] for o in own if o.startswith("experiment=")]
    return settings, (chosen or ["one"])[-1], plan_cells(settings, foreign, compose_sim)


def compose_sim(overrides: Sequence[str]) -> SimConfig:
    """The config of a dataset, by the overrides of ``python -m sim``."""
    return build(SimConfig, compose_config(conf_folder(), "sim", overrides))


def _quote_command(argument: str) -> str:
    """A command's words are its own: no comma or brace in it means anything to hydra."""
    key, _, value = argument.partition("=")
    if key != "method.command" or value[:1] in ("'", '"'):
        return argument
    escaped = value.replace("\\", "\\\\").replace("'", "\\'")
    return f"{key}='{escaped}'"


def _root_key(override: str) -> str:
    return override.partition("=")[0].split(".")[0]


def _check_sources(cells: Sequence[Cell]) -> None:
    """Refuse a world or a log that cannot be used, each once."""
    configs = {(c.dataset.config.world, c.dataset.config.source): c.dataset.config for c in cells}
    for config in configs.values():
        check_source(config)


def _tick(bar: "tqdm[Any]", scored: ScoredCell) -> None:
    bar.set_postfix_str(f"{scored.cell.dataset.label} {scored.cell.method.label} {scored.score['status']}")
    bar.update()


def _command(arguments: Sequence[str]) -> str:
    return " ".join(["python -m bench", *(f"'{a}'" if " " in a else a for a in arguments)])


def _help() -> str:
    names = sorted(path.stem for path in (conf_folder() / "experiment").glob("*.yaml"))
    experiments = "\n".join(f"  {name:20} {_title(name)}" for name in names)
    keys = "\n".join(f"  {item.name}" for item in fields(BenchSettings))
    return f"{_USAGE}\n\nExperiments:\n{experiments}\n\nKeys (all others are those of `python -m sim`):\n{keys}"


def _title(name: str) -> str:
    document = yaml.safe_load((conf_folder() / "experiment" / f"{name}.yaml").read_text(encoding="utf-8"))
    return str(document.get("title", ""))
