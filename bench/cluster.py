"""Beyond one machine: hydra's launchers run the datasets of a plan as jobs, which fill the store in a shared folder.

A job leaves nothing but finished cells; whoever launched it gathers them from the store, as if it had run them itself.
"""

import hashlib
import os
import pickle
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from bench.cell import Cell
from bench.one_line import one_line as shorten
from bench.run import RunOptions, run_cells
from bench.store import Store, write_bytes
from sim.hydra_schema import OverrideError, one_line


class LaunchError(ValueError):
    """Jobs did not come to their end; the message is one line."""


def check_launcher(conf: Path, overrides: Sequence[str]) -> None:
    """Refuse a launcher that cannot start here, or a key that it lacks, before anything is written.

    Raises:
        OverrideError: one of the overrides cannot be used.
    """
    GlobalHydra.instance().clear()
    try:
        with hydra.initialize_config_dir(str(conf.absolute()), version_base="1.3"):
            config = hydra.compose("bench_job", overrides=list(overrides), return_hydra_config=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise OverrideError(one_line(error)) from None
    if str(config.hydra.launcher.get("_target_")).endswith("SlurmLauncher") and not shutil.which("srun"):
        raise OverrideError("hydra/launcher: no srun on this machine: launch from a node of the Slurm cluster")


def launch_jobs(cells: Sequence[Cell], out: Path, options: RunOptions, conf: Path, overrides: Sequence[str]) -> None:
    """Run cells as jobs of one of hydra's launchers, and wait for them.

    Args:
        cells: What is measured; the cells of one dataset are one job.
        out: Folder of results, which every job must see; the store lies there.
        options: How a job runs its cells.
        conf: Folder of the configuration.
        overrides: ``hydra/launcher=NAME`` and ``hydra.launcher.KEY=VALUE``.

    Raises:
        LaunchError: the launcher could not start a job, or a job died.
    """
    jobs = _group(cells)
    content = pickle.dumps((jobs, Store(out.absolute() / "store"), options))
    plan = (out / "store" / "plans" / f"{hashlib.sha256(content).hexdigest()[:20]}.pickle").absolute()
    write_bytes(plan, content)  # jobs that wait for a node find theirs, whatever is launched meanwhile
    numbers = ",".join(str(k) for k in range(len(jobs)))
    words = [f"job={numbers}", f"plan='{plan}'", f"hydra.sweep.dir='{out.absolute() / 'store' / 'jobs'}'", *overrides]
    before, sys.argv = sys.argv, [sys.argv[0], "-m", *words]
    os.environ.setdefault("HYDRA_FULL_ERROR", "1")  # else hydra prints what happened and ends the program
    try:
        hydra.main(version_base="1.3", config_path=str(conf.absolute()), config_name="bench_job")(run_job)()
    except Exception as error:  # noqa: BLE001  # whatever a launcher raises
        said = shorten(f"{type(error).__name__}: {error}")
        raise LaunchError(
            f"a job ended early; what is finished is kept, the same command goes on from there ({said})"
        ) from None
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
