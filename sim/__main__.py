"""``python -m sim key=value ...`` writes a dataset, ``-m`` a collection; ``python -m sim check DIR`` verifies one."""

import json
import logging
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from tqdm import tqdm
from tqdm.contrib.logging import logging_redirect_tqdm

from sim.config import SimConfig, dataset_name
from sim.datasets.collection import TABLE, CollectionItem, make_collection
from sim.datasets.dataset import make_dataset
from sim.datasets.dataset_check import check_dataset
from sim.datasets.manifest import compare_manifest, make_manifest, read_manifest
from sim.hydra_schema import build, compose_config
from sim.resources import conf_folder
from sim.sim_schema import GROUPS, ROOT, RunConfig, register_schema, usage
from sim.source import check_source
from sim.sweep import expand_sweep


def main() -> None:
    """Run the command line: exit status 0, 1 (unsound or not all made) or 2 (bad input or usage)."""
    try:
        sys.exit(_run(sys.argv[1:]))
    except (ValueError, OSError) as error:
        print(f"sim: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    except MemoryError as error:
        print(f"sim: not enough memory ({str(error) or 'none left'})", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


def _run(arguments: list[str]) -> int:
    register_schema()
    if {"-h", "--help"} & set(arguments):
        print(usage(conf_folder()))
        return 0
    if arguments[:1] == ["check"]:
        return _check(arguments[1:])
    if arguments[:1] == ["manifest"]:
        return _print_manifest(arguments[1:])
    if arguments[:1] == ["compare"]:
        return _compare(arguments[1:])
    if {"-m", "--multirun"} & set(arguments):
        return _make_many([word for word in arguments if word not in ("-m", "--multirun")])
    return _make(compose_config(conf_folder(), ROOT, arguments))


def _check(folders: Sequence[str]) -> int:
    """Print what is wrong with each dataset."""
    if not folders:
        raise ValueError("check needs the folder of a dataset")
    faults = [fault for folder in folders for fault in check_dataset(Path(folder))]
    for fault in faults:
        print(fault)
    if not faults:
        print("sound: " + ", ".join(folders))
    return 1 if faults else 0


def _print_manifest(folders: Sequence[str]) -> int:
    """Print the manifest of a dataset, as it stands beside the presets."""
    if len(folders) != 1:
        raise ValueError("manifest needs the folder of one dataset")
    print(json.dumps(make_manifest(Path(folders[0])), indent=1))
    return 0


def _compare(paths: Sequence[str]) -> int:
    """Print in what a dataset is not as its manifest says."""
    if len(paths) != 2:
        raise ValueError("compare needs the folder of one dataset and its manifest")
    folder, manifest = map(Path, paths)
    faults = compare_manifest(folder, read_manifest(manifest))
    print("\n".join(faults) if faults else f"{folder} is as {manifest} says")
    return 1 if faults else 0


def _make(node: DictConfig) -> int:
    """Make one dataset."""
    config, run = build(SimConfig, node), build(RunConfig, node)
    out = Path(run.out or f"out/{dataset_name(config)}")
    _log_to_terminal(run.quiet)
    with closing(_Bars(run.quiet)) as progress, logging_redirect_tqdm():
        make_dataset(config, out, workers=run.num_workers, progress=progress)
    if not run.quiet:
        print(out)
    return 0


def _make_many(overrides: list[str]) -> int:
    """Make a collection."""
    points = expand_sweep(conf_folder(), ROOT, overrides, GROUPS)
    items = [CollectionItem(point.label, build(SimConfig, point.config), point.parameters) for point in points]
    run = build(RunConfig, points[0].config)
    swept = [key for key in points[0].parameters if key in RunConfig.__dataclass_fields__]
    if swept:
        raise ValueError(f"{swept[0]} is a setting of the whole run, and cannot be swept")
    for config in {(item.config.world, item.config.source): item.config for item in items}.values():
        check_source(config)
    out = Path(run.out or "out/collection")
    _log_to_terminal(run.quiet)
    with closing(_Bars(run.quiet, always=True)) as progress, logging_redirect_tqdm():
        faults = make_collection(items, out, workers=run.num_workers, progress=progress)
    for label, fault in faults.items():
        print(f"sim: {label}: {fault}", file=sys.stderr)
    if not run.quiet:
        print(f"{out / TABLE}: {len(items) - len(faults)} of {len(items)} datasets")
    return 1 if faults else 0


def _log_to_terminal(quiet: bool) -> None:
    """Warnings go to stderr, one line each, unless quiet was asked for."""
    logging.basicConfig(format="sim: %(message)s", level=logging.ERROR if quiet else logging.WARNING)


class _Bars:
    """One progress bar for each stage, on a terminal or always."""

    def __init__(self, quiet: bool, *, always: bool = False) -> None:
        self._disable = True if quiet else False if always else None
        self._stage = ""
        self._bar: tqdm[Any] | None = None

    def __call__(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self.close()
            self._stage = stage
            self._bar = tqdm(total=total, desc=stage, unit="", disable=self._disable, leave=False)
        if self._bar is not None:
            self._bar.update(done - self._bar.n)

    def close(self) -> None:
        """Clear the last bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


if __name__ == "__main__":
    main()
