"""Is a dataset folder what it says it is? Checksums, schemas, and the truth against the recording."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from merger.grid_map import GridMap
from merger.map_server import read_map
from sim.datasets.dataset_folder import INDEX, DatasetError, encode_index, file_sha256, read_index
from sim.maps.truth import Truth, TruthError, read_truth
from sim.recordings.recording_reader import RecordedTruth, read_recorded_truth
from sim.recordings.tum import read_tum

_TOLERANCE = 1e-6
"""Metres and radians by which two files may differ in the same motion."""
_REQUIRED = ("recording.mcap", "truth.json", "scans.log", "world.png", "overview.png", "README.md")


def check_dataset(folder: Path) -> list[str]:
    """All faults of a dataset folder, one line each; none if it is sound.

    Checked are: the index and its schema; that the files are just those of the index, with their checksums; the
    files that every dataset has; the schema and ranges of ``truth.json``; that every map can be read; that the
    recording holds the same settings, maps, places, true poses and truth.json as the other files.
    """
    try:
        index = read_index(folder)
    except DatasetError as error:
        return [str(error)]
    faults = [*_check_files(folder, index["files"])]
    if (folder / INDEX).read_bytes() != encode_index(index):
        faults.append(f"{folder / INDEX}: has changed (it is not written as datasets are)")
    try:
        truth = read_truth(folder / "truth.json")
    except TruthError as error:
        return [*faults, str(error)]
    faults += _check_truth(truth)
    return [*faults, *_check_recording(folder, truth, index)]


def _check_files(folder: Path, checksums: dict[str, Any]) -> Iterator[str]:
    """Files against the index, both ways."""
    found = (path for path in folder.rglob("*") if path.is_file() or path.is_symlink())
    present = {path.relative_to(folder).as_posix() for path in found} - {INDEX}
    for name in sorted(set(_REQUIRED) - set(checksums)):
        yield f"{folder}: {name} is not in the index"
    for name in sorted(present - set(checksums)):
        yield f"{folder}: {name} does not belong to the dataset"
    for name, checksum in checksums.items():
        if name not in present:
            yield f"{folder}: {name} is missing"
        elif file_sha256(folder / name) != checksum:
            yield f"{folder}: {name} has changed (its SHA-256 differs)"


def _check_truth(truth: Truth) -> Iterator[str]:
    """Ranges of the truth's values."""
    if not truth.names:
        yield "truth.json: there is no map"
    if not np.isfinite(truth.T_world_map).all():
        yield "truth.json: a motion is not finite"
    if not (truth.distortion_rms_m >= 0.0).all():
        yield "truth.json: distortion_rms_m must be >= 0"
    if not ((truth.overlap >= 0.0) & (truth.overlap <= 1.0)).all():
        yield "truth.json: overlap fractions must be in [0, 1]"


def _check_recording(folder: Path, truth: Truth, index: dict[str, Any]) -> Iterator[str]:
    """The recording against index, maps, truth and trajectories."""
    path = folder / "recording.mcap"
    try:
        recorded = read_recorded_truth(path)
    except ValueError as error:
        yield str(error)
        return
    if recorded.truth_json != (folder / "truth.json").read_bytes():
        yield f"{path}: its attachment truth.json differs from the folder's"
    yield from _check_index(folder, recorded, index)
    yield from _check_places(path, recorded, truth)
    for name in truth.names:
        try:
            stored = read_map(folder / "maps" / f"{name}.yaml")
        except ValueError as error:
            yield str(error)
        else:
            yield from _check_map(path, recorded.maps.get(name), stored)
    for robot in sorted(set(truth.robot)):
        yield from _check_trajectory(folder, recorded, robot)


def _check_index(folder: Path, recorded: RecordedTruth, index: dict[str, Any]) -> Iterator[str]:
    """The index, which no checksum guards, against what the recording says of the dataset."""
    for key in ("name", "seed", "version"):
        if recorded.metadata.get(key) != str(index[key]):
            yield f"{folder / INDEX}: its {key} is not the recording's"
    if recorded.config_json != (json.dumps(index["config"], indent=1) + "\n").encode():
        yield f"{folder / INDEX}: its config is not the recording's"


def _check_places(path: Path, recorded: RecordedTruth, truth: Truth) -> Iterator[str]:
    for kind, T in (("transforms", recorded.T_world_submap), ("poses", recorded.T_world_pose)):
        if T.shape != truth.T_world_map.shape:
            yield f"{path}: {len(T)} {kind} of submaps, truth.json has {len(truth.names)}"
        elif np.abs(T - truth.T_world_map).max() > _TOLERANCE:
            name = truth.names[int(np.abs(T - truth.T_world_map).max(axis=(1, 2)).argmax())]
            yield f"{path}: its {kind} of submaps differ from truth.json (most for {name})"


def _check_map(path: Path, recorded: GridMap | None, stored: GridMap) -> Iterator[str]:
    if recorded is None:
        yield f"{path}: it has no grid of {stored.name}"
        return
    same = recorded.log_odds.shape == stored.log_odds.shape
    if not (same and np.array_equal(recorded.occupied, stored.occupied) and np.array_equal(recorded.free, stored.free)):
        yield f"{path}: its cells of {stored.name} differ from the map file's"
    if np.abs(recorded.T_map_grid - stored.T_map_grid).max() > _TOLERANCE:
        yield f"{path}: its origin of {stored.name} differs from the map file's"


def _check_trajectory(folder: Path, recorded: RecordedTruth, robot: str) -> Iterator[str]:
    path = folder / "trajectories" / f"{robot}_truth.tum"
    try:
        stamps_s, T_world_robot = read_tum(path)
    except (OSError, ValueError) as error:
        yield f"{path}: cannot be read ({error})"
        return
    poses = recorded.trajectories.get(robot)
    if poses is None or len(poses[0]) != len(stamps_s):
        yield f"{path}: {len(stamps_s)} poses, the recording has {0 if poses is None else len(poses[0])}"
        return
    order = np.argsort(poses[0], kind="stable")
    worst = max(np.abs(poses[0][order] - stamps_s).max(), np.abs(poses[1][order] - T_world_robot).max())
    if worst > _TOLERANCE:
        yield f"{path}: its poses differ from the recording's"
    if recorded.num_scans.get(robot) != len(stamps_s):
        yield f"{path}: {len(stamps_s)} poses, the recording has {recorded.num_scans.get(robot, 0)} scans"
