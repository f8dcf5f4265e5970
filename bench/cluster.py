"""Beyond one machine: hydra's launchers run the datasets of a plan as jobs, which fill the store in a shared folder.

A job leaves nothing but finished cells; whoever launched it gathers them from the store, as if it had run them itself.
"""

import pickle
import sys
from collections.abc import Sequence
from pathlib import Path

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from bench.cell import Cell
from bench.run import RunOptions, run_cells
from bench.store import Store, write_bytes
from sim.hydra_schema import OverrideError, one_line

_PLAN = "plan.pickle"


def check_launcher(conf: Path, overrides: Sequence[str]) -> None:
    """Refuse a launcher that hydra does not know, or a key that the launcher lacks, before anything is written.

    Raises:
        OverrideError: one of the overrides cannot be used.
    """
    GlobalHydra.instance().clear()
    try:
        with hydra.initialize_config_dir(str(conf.absolute()), version_base="1.3"):
            hydra.compose("bench_job", overrides=list(overrides), return_hydra_config=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise OverrideError(one_line(error)) from None


def launch_jobs(cells: Sequence[Cell], out: Path, options: RunOptions, conf: Path, overrides: Sequence[str]) -> None:
    """Run cells as jobs of one of hydra's launchers, and wait for them.

    Args:
        cells: What is measured; the cells of one dataset are one job.
        out: Folder of results, which every job must see; the store lies there.
        options: How a job runs its cells.
        conf: Folder of the configuration.
        overrides: ``hydra/launcher=NAME`` and ``hydra.launcher.KEY=VALUE``.

    Raises:
        Exception: what hydra or the launcher raises.
    """
    jobs = _group(cells)
    plan = (out / "store" / _PLAN).absolute()
    write_bytes(plan, pickle.dumps((jobs, Store(out.absolute() / "store"), options)))
    numbers = ",".join(str(k) for k in range(len(jobs)))
    words = [f"job={numbers}", f"plan='{plan}'", f"hydra.sweep.dir='{plan.parent / 'jobs'}'", *overrides]
    before, sys.argv = sys.argv, [sys.argv[0], "-m", *words]
    try:
        hydra.main(version_base="1.3", config_path=str(conf.absolute()), config_name="bench_job")(run_job)()
    finally:
        sys.argv = before


def run_job(config: DictConfig) -> None:
    """One job: finish the cells of one dataset; runs wherever the launcher puts it."""
    jobs, store, options = pickle.loads(Path(config.plan).read_bytes())
    run_cells(jobs[config.job], store, options)


def _group(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Cells by dataset and swept point; seeds, orders and methods stay together."""
    groups: dict[tuple[object, ...], list[Cell]] = {}
    for cell in cells:
        groups.setdefault((cell.dataset.label, cell.dataset.swept), []).append(cell)
    return list(groups.values())
