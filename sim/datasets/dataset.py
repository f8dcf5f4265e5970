"""A dataset: made from a config, and read back."""

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from merger.grid_map import GridMap
from merger.map_server import read_map
from sim.config import SimConfig, num_submaps
from sim.datasets.dataset_files import DatasetContent, write_files
from sim.datasets.dataset_folder import new_folder, read_index, refuse_to_overwrite
from sim.maps.missed_overlaps import warn_of_missed
from sim.maps.overlap_search import find_cuts
from sim.maps.submap_mapping import SubmapResult, map_submap
from sim.maps.submap_poses import expect_odometry
from sim.maps.submaps import SubmapCut, cut_submaps, draw_submap_frame
from sim.maps.truth import Truth, find_truth, read_truth
from sim.robot_run import RobotRun
from sim.source import make_source
from sim.streams import Purpose, make_stream

Progress = Callable[[str, int, int], None]
"""``progress(stage, done, total)``."""


@dataclass(frozen=True)
class Dataset:
    """What a merger needs, and what a score needs."""

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
        workers: Threads that map submaps, >= 1; the result does not depend on it.
        progress: Called when a stage begins and after each of its steps.

    Returns:
        The folder.

    Raises:
        DatasetError: ``out`` is something else than a dataset, and would be lost.
        ValueError: the source cannot be used, or the configuration asks for the impossible.
    """
    report = progress or _stay_quiet
    refuse_to_overwrite(out)
    report("runs", 0, 1)
    source = make_source(config)
    cuts = _cut(config, source.runs)
    submaps = _map_submaps(config, source.runs, cuts, workers, report)
    truth = find_truth([run.trajectory for run in source.runs], cuts, submaps)
    if config.submaps.measured_overlap is not None:
        warn_of_missed(truth, config.submaps.measured_overlap)
    with new_folder(out) as folder:
        write_files(folder, DatasetContent(config, source, cuts, submaps, truth), report)
    return out


def read_dataset(path: Path) -> Dataset:
    """Read a dataset's maps and truth.

    Raises:
        DatasetError: the folder is not a dataset.
        ValueError: one of its files cannot be used.
    """
    index = read_index(path)
    truth = read_truth(path / "truth.json")
    maps = tuple(read_map(path / "maps" / f"{name}.yaml") for name in truth.names)
    return Dataset(path, index["name"], index["config"], maps, truth)


def _cut(config: SimConfig, runs: Sequence[RobotRun]) -> list[SubmapCut]:
    """By the share of scans, or by the overlap that is measured in the maps."""
    count, target = num_submaps(config), config.submaps.measured_overlap
    if target is not None:
        return find_cuts(runs, count, target, config.mapping.occupancy, functools.partial(_map_submap, config, runs))
    return cut_submaps([run.num_scans for run in runs], count, config.submaps.overlap)


def _map_submap(config: SimConfig, runs: Sequence[RobotRun], index: int, cut: SubmapCut) -> SubmapResult:
    """One submap in a frame of its own."""
    mapping = replace(config.mapping, estimation=expect_odometry(config.mapping.estimation, config.odometry))
    frame = draw_submap_frame(config.submaps, make_stream(config.seed, Purpose.SUBMAP_FRAME, index))
    return map_submap(runs[cut.robot], cut.start, cut.stop, mapping, name=cut.name, T_map_first=frame)


def _map_submaps(
    config: SimConfig, runs: Sequence[RobotRun], cuts: Sequence[SubmapCut], workers: int, report: Progress
) -> list[SubmapResult]:
    """Every submap; in threads, since the kernels let others run meanwhile."""
    submaps = []
    report("submaps", 0, len(cuts))
    with ThreadPoolExecutor(workers) as pool:
        for submap in pool.map(functools.partial(_map_submap, config, runs), range(len(cuts)), cuts):
            submaps.append(submap)
            report("submaps", len(submaps), len(cuts))
    return submaps


def _stay_quiet(stage: str, done: int, total: int) -> None:
    """No progress is asked for."""
