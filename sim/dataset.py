"""A dataset folder: made whole or not at all, and read back."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from merger.grid_map import GridMap
from merger.map_server import read_map, write_map
from sim.carmen import read_carmen
from sim.config import SimConfig, SourceKind, to_plain_dict
from sim.robot_run import RobotRun
from sim.submap_mapping import SubmapResult, map_submap
from sim.submaps import SubmapCut, cut_submaps, draw_submap_frame
from sim.truth import Truth, align_poses, overlap_fractions, read_truth, write_truth
from sim.version import package_version

INDEX = "dataset.json"
"""The file that makes a folder a dataset; written last."""
Progress = Callable[[str, int, int], None]
"""``progress(stage, done, total)``."""
_FRAME_STREAM = 1
"""Random stream of the submaps' frames."""
_DEFAULT_COUNT = 8
"""Submaps of a log."""


class DatasetError(ValueError):
    """A dataset cannot be read or written; the message is one line that names the folder and the fault."""


@dataclass(frozen=True)
class Dataset:
    """What a merger needs and what a score needs."""

    path: Path
    """The folder."""
    name: str
    """Name of the dataset."""
    config: dict[str, Any]
    """The resolved configuration."""
    maps: tuple[GridMap, ...]
    """The submaps, by name."""
    truth: Truth
    """Their true places."""


def make_dataset(config: SimConfig, out: Path, *, workers: int = 1, progress: Progress | None = None) -> Path:
    """Make a dataset and write its folder, whole or not at all; an older dataset in its place is replaced.

    Args:
        config: What makes it.
        out: The folder to write: new, empty, or an older dataset.
        workers: Threads that map submaps; the result does not depend on it.
        progress: Called with each stage's steps.

    Returns:
        The folder.

    Raises:
        DatasetError: ``out`` is something else than a dataset, and would be lost.
        ValueError: the source cannot be read, or the configuration asks for the impossible.
    """
    _refuse_to_overwrite(out)
    runs = _make_runs(config)
    cuts = cut_submaps([run.num_scans for run in runs], config.submaps.count or _DEFAULT_COUNT, config.submaps.overlap)
    submaps = _map_submaps(config, runs, cuts, progress)
    truth = _make_truth(runs, cuts, submaps)
    partial = _begin_folder(out)
    try:
        _write_files(partial, config, submaps, truth)
        _finish_folder(partial, out)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return out


def read_dataset(path: Path) -> Dataset:
    """Read a dataset's maps and truth.

    Raises:
        DatasetError: the folder is not a dataset.
        ValueError: one of its files cannot be used.
    """
    try:
        index = json.loads((path / INDEX).read_text(encoding="utf-8"))
        name, config = str(index["name"]), dict(index["config"])
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, ValueError):
        raise DatasetError(f"{path}: not a dataset (no readable {INDEX})") from None
    truth = read_truth(path / "truth.json")
    maps = tuple(read_map(path / "maps" / f"{map_name}.yaml") for map_name in truth.names)
    return Dataset(path, name, config, maps, truth)


def _make_runs(config: SimConfig) -> list[RobotRun]:
    if config.source.kind is SourceKind.CARMEN:
        return read_carmen(Path(config.source.path or ""))
    raise DatasetError("source=simulated: not built yet")


def _map_submaps(
    config: SimConfig, runs: Sequence[RobotRun], cuts: Sequence[SubmapCut], progress: Progress | None
) -> list[SubmapResult]:
    submaps = []
    for index, cut in enumerate(cuts):
        rng = np.random.default_rng(np.random.SeedSequence(config.seed, spawn_key=(_FRAME_STREAM, index)))
        frame = draw_submap_frame(config.submaps, rng)
        run = runs[cut.robot]
        submaps.append(map_submap(run, cut.start, cut.stop, config.mapping, name=cut.name, T_map_first=frame))
        if progress:
            progress("submaps", index + 1, len(cuts))
    return submaps


def _make_truth(runs: Sequence[RobotRun], cuts: Sequence[SubmapCut], submaps: Sequence[SubmapResult]) -> Truth:
    trajectories = [runs[cut.robot].trajectory for cut in cuts]
    fits = [
        align_poses(trajectory.T_world_robot[cut.start : cut.stop], submap.T_map_robot)
        for trajectory, cut, submap in zip(trajectories, cuts, submaps, strict=True)
    ]
    T_world_map = np.stack([T for T, _ in fits])
    return Truth(
        names=tuple(cut.name for cut in cuts),
        T_world_map=T_world_map,
        distortion_rms_m=np.array([rms for _, rms in fits]),
        robot=tuple(trajectory.robot for trajectory in trajectories),
        start_s=np.array([t.stamps_s[cut.start] for t, cut in zip(trajectories, cuts, strict=True)]),
        end_s=np.array([t.stamps_s[cut.stop - 1] for t, cut in zip(trajectories, cuts, strict=True)]),
        overlap=overlap_fractions([submap.grid for submap in submaps], T_world_map),
    )


def _write_files(folder: Path, config: SimConfig, submaps: Sequence[SubmapResult], truth: Truth) -> None:
    (folder / "maps").mkdir()
    for submap in submaps:
        write_map(folder / "maps" / f"{submap.grid.name}.yaml", submap.grid)
    write_truth(folder / "truth.json", truth)
    files = {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    index = {
        "schema": 1,
        "name": _dataset_name(config),
        "seed": config.seed,
        "version": package_version(),
        "config": to_plain_dict(config),
        "files": files,
    }
    (folder / INDEX).write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")


def _dataset_name(config: SimConfig) -> str:
    if config.source.kind is SourceKind.CARMEN:
        building = Path(config.source.path or "").name.split(".")[0]
    else:
        building = Path(config.world).stem
    return config.name or f"{building}-{config.seed}"


def _refuse_to_overwrite(out: Path) -> None:
    if out.is_dir():
        if any(out.iterdir()) and not (out / INDEX).is_file():
            raise DatasetError(f"{out}: the folder holds something else than a dataset, and is not overwritten")
    elif out.exists() or out.is_symlink():
        raise DatasetError(f"{out}: is not a folder, and is not overwritten")


def _begin_folder(out: Path) -> Path:
    """A new hidden folder beside ``out``; what killed processes left there is removed."""
    out = out.absolute()
    out.parent.mkdir(parents=True, exist_ok=True)
    for old in out.parent.glob(f".{out.name}.*.partial"):
        owner = old.name.split(".")[-2]
        if not (owner.isdigit() and psutil.pid_exists(int(owner))):
            shutil.rmtree(old, ignore_errors=True)
    partial = out.with_name(f".{out.name}.{os.getpid()}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir()
    return partial


def _finish_folder(partial: Path, out: Path) -> None:
    """Give a finished folder its name; an older dataset disappears first."""
    if out.is_dir() and any(out.iterdir()):
        old = partial.with_name(f".{out.name}.{os.getpid()}.old.partial")
        out.rename(old)
        shutil.rmtree(old)
    partial.rename(out)
