"""``python -m sim key=value ...`` writes a dataset; ``python -m sim check DIR`` verifies one."""

import sys
from dataclasses import dataclass
from pathlib import Path

from omegaconf import OmegaConf

from sim.config import SimConfig
from sim.dataset import make_dataset
from sim.hydra_schema import build, compose_config, register
from sim.resources import conf_folder


@dataclass(frozen=True)
class _Root(SimConfig):
    """The keys of the command line: what makes a dataset, and what only concerns this run."""

    out: str | None = None
    """Folder to write; none: ``out/NAME``."""
    workers: int = 1
    """Processes or threads, >= 1; the result does not depend on it."""
    quiet: bool = False
    """No progress."""


def main() -> None:
    """Run the command line."""
    try:
        _run(sys.argv[1:])
    except (ValueError, OSError) as error:
        print(f"sim: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


def _run(arguments: list[str]) -> None:
    register("sim_schema", _Root)
    node = compose_config(conf_folder(), "sim", arguments)
    config = build(SimConfig, node)
    out = Path(node.out or "out/dataset")
    make_dataset(config, out, workers=node.workers)
    print(out)
    OmegaConf.create()


if __name__ == "__main__":
    main()
