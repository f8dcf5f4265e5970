"""``python -m bench``: from the words of the command line to a finished experiment."""

import functools
import importlib
import re
import shlex
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from tqdm import tqdm

from bench.cell import Cell, Setting
from bench.cluster import check_launcher, launch_jobs
from bench.command_help import help_text
from bench.command_words import HELP, read_words, root_key
from bench.out_folder import STORE, claim_folder
from bench.plan import parse_value, plan_cells
from bench.run import RunOptions, run_cells
from bench.settings import BenchSettings, read_settings
from bench.stages import ScoredCell, keys_of
from bench.store import Store
from sim.config import SimConfig
from sim.hydra_schema import build, compose_config, register
from sim.resources import conf_folder
from sim.sim_schema import register_schema
from sim.source import check_source

_NAMED = ("world", "seed", "seeds", "method", "methods", "method.name")
"""Keys that have columns of their own in every row."""
_PLAIN = re.compile(r"[\w@%+=:,./\[\]-]+")
_OWN_KEYS = {"experiment", *(item.name for item in fields(BenchSettings))}


@dataclass(frozen=True)
class CommandAnswer:
    """What a command line came to."""

    text: str
    """What there is to print: a table, or nothing if it is to be quiet."""
    fault: str | None = None
    """Why the run as a whole was in vain: not one of its rows is ok."""


def run_command(arguments: list[str]) -> CommandAnswer:
    """Run an experiment as its command line says.

    Raises:
        ValueError: a key, a value or a folder cannot be used.
    """
    if any(argument in HELP for argument in arguments):
        return CommandAnswer(help_text())
    register("bench_schema", BenchSettings)
    register_schema()
    words = read_words(arguments)
    planned = [_plan(job, words.swept) for job in words.jobs]
    settings, name = planned[0][0], planned[0][1]
    cells = list({keys_of(cell).score: cell for _, _, job_cells in planned for cell in job_cells}.values())
    if not cells:
        raise ValueError(f"experiment '{name}' has only datasets that are cut from logs: name their folder, logs=DIR")
    if words.launcher:
        check_launcher(conf_folder(), words.launcher)
    _check_sources(cells)
    out = Path(settings.out or f"out/{name}").expanduser()
    claim_folder(out)
    store = Store(out / STORE)
    options = RunOptions(settings.workers, settings.retry_failed)
    if words.launcher:
        launch_jobs(cells, out, options, conf_folder(), words.launcher)
    threading.Thread(target=importlib.import_module, args=("bench.experiment",), daemon=True).start()
    with tqdm(total=len(cells), unit="cell", disable=settings.quiet, dynamic_ncols=True) as bar:
        done = run_cells(cells, store, options, lambda cell, _done, _total: _tick(bar, cell))
    from bench.experiment import Experiment, write_experiment  # noqa: PLC0415  # pandas, matplotlib: not before rows run

    text = write_experiment(Experiment(name, settings, tuple(done), _command(arguments)), out)
    return CommandAnswer("" if settings.quiet else text, _fault(done))


def _plan(overrides: Sequence[str], swept: Sequence[str]) -> tuple[BenchSettings, str, list[Cell]]:
    own = tuple(o for o in overrides if root_key(o) in _OWN_KEYS)
    foreign = [o for o in overrides if root_key(o) not in _OWN_KEYS]
    settings = _compose_settings(own)
    chosen = [o.partition("=")[2] for o in own if o.startswith("experiment=")]
    columns = {key: _last_value(overrides, key) for key in swept if key not in _NAMED}
    cells = [_add_columns(cell, columns) for cell in plan_cells(settings, foreign, compose_sim)]
    return settings, (chosen or ["one"])[-1], cells


@functools.lru_cache(maxsize=1)
def _compose_settings(own: tuple[str, ...]) -> BenchSettings:
    """The settings of the bench itself, which the jobs of a sweep mostly share; hydra takes long to compose them."""
    node: Any = OmegaConf.to_container(compose_config(conf_folder(), "bench", own), resolve=True)
    return read_settings(node)


def _last_value(overrides: Sequence[str], key: str) -> Setting:
    return parse_value([o.partition("=")[2] for o in overrides if o.partition("=")[0] == key][-1])


def _add_columns(cell: Cell, columns: dict[str, Setting]) -> Cell:
    """A cell whose row says the value of every swept key, whatever the key concerns."""
    swept = tuple((columns | dict(cell.dataset.swept)).items())
    return replace(cell, dataset=replace(cell.dataset, swept=swept))


def compose_sim(overrides: Sequence[str]) -> SimConfig:
    """The config of a dataset, by the overrides of ``python -m sim``."""
    return build(SimConfig, compose_config(conf_folder(), "sim", overrides))


def _check_sources(cells: Sequence[Cell]) -> None:
    """Refuse a world or a log that cannot be used, each once."""
    configs = {(c.dataset.config.world, c.dataset.config.source): c.dataset.config for c in cells}
    for config in configs.values():
        check_source(config)


def _tick(bar: "tqdm[Any]", scored: ScoredCell) -> None:
    bar.set_postfix_str(f"{scored.cell.dataset.label} {scored.cell.method.label} {scored.score['status']}")
    bar.update()


def _fault(cells: Sequence[ScoredCell]) -> str | None:
    """What all cells ended of, said for the commonest reason; none if one of them is ok."""
    ends = Counter((cell.score["status"], cell.score["reason"]) for cell in cells)
    if any(status == "ok" for status, _ in ends):
        return None
    (status, reason), count = ends.most_common(1)[0]
    return f"not one of {len(cells)} rows is ok; {count} {status}: {reason}"


def _command(arguments: Sequence[str]) -> str:
    """The command line as a shell takes it."""
    return " ".join(["python -m bench", *(a if _PLAIN.fullmatch(a) else shlex.quote(a) for a in arguments)])
