"""The files of a dataset folder, from maps to the card; the index comes last."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger.map_server import write_map
from sim.config import SimConfig, dataset_name, to_plain_dict
from sim.datasets.card import write_card
from sim.datasets.dataset_folder import write_index
from sim.datasets.figures import draw_overview, draw_world
from sim.maps.submap_mapping import SubmapResult
from sim.maps.submaps import SubmapCut
from sim.maps.truth import Truth, write_truth
from sim.recordings.recording import PlacedSubmap, Recording, write_recording
from sim.recordings.scan_log import write_scan_log
from sim.recordings.tum import write_tum
from sim.source import Source
from sim.version import package_version


@dataclass(frozen=True)
class DatasetContent:
    """All that the files are written from."""

    config: SimConfig
    """What made it."""
    source: Source
    """The runs and the building."""
    cuts: Sequence[SubmapCut]
    """The scans of each submap."""
    submaps: Sequence[SubmapResult]
    """The submaps, in the order of the cuts."""
    truth: Truth
    """Their true places."""

    @property
    def name(self) -> str:
        """Name of the dataset."""
        return dataset_name(self.config)


def write_files(folder: Path, content: DatasetContent, report: Callable[[str, int, int], None]) -> None:
    """Write every file of the folder, ``dataset.json`` last."""
    steps = (_write_maps, _write_trajectories, _write_scan_log, _write_recording, _write_pictures, _write_card)
    for number, step in enumerate(steps):
        report("files", number, len(steps))
        step(folder, content)
    config = to_plain_dict(content.config)
    fields = {"name": content.name, "seed": content.config.seed, "version": package_version(), "config": config}
    write_index(folder, fields)
    report("files", len(steps), len(steps))


def _write_maps(folder: Path, content: DatasetContent) -> None:
    (folder / "maps").mkdir()
    for submap in content.submaps:
        write_map(folder / "maps" / f"{submap.grid.name}.yaml", submap.grid)
    write_truth(folder / "truth.json", content.truth)


def _write_trajectories(folder: Path, content: DatasetContent) -> None:
    (folder / "trajectories").mkdir()
    for robot, run in enumerate(content.source.runs):
        trajectory = run.trajectory
        everywhere = np.ones(run.num_scans, dtype=np.bool_)
        told = trajectory.T_world_odom @ trajectory.T_odom_robot
        poses = {
            "truth": (trajectory.T_world_robot, everywhere),
            "odometry": (told, everywhere),
            "estimate": estimated_poses(content, robot),
        }
        for kind, (T, known) in poses.items():
            path = folder / "trajectories" / f"{trajectory.robot}_{kind}.tum"
            write_tum(path, trajectory.stamps_s[known], T[known])


def estimated_poses(content: DatasetContent, robot: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Poses of a robot as its submaps were mapped, each submap at its true place.

    Returns:
        (N, 3, 3) poses: a scan of several submaps has the pose that the first of them gave it; and the (N,) mask of
        the scans that belong to a submap.
    """
    T = np.tile(np.eye(3), (content.source.runs[robot].num_scans, 1, 1))
    known = np.zeros(len(T), dtype=np.bool_)
    for cut, submap, T_world_map in zip(content.cuts, content.submaps, content.truth.T_world_map, strict=True):
        if cut.robot == robot:
            new = ~known[cut.start : cut.stop]
            T[cut.start : cut.stop][new] = (T_world_map @ submap.T_map_robot)[new]
            known[cut.start : cut.stop] = True
    return T, known


def _write_scan_log(folder: Path, content: DatasetContent) -> None:
    write_scan_log(folder / "scans.log", content.source.runs, content.name)


def _write_recording(folder: Path, content: DatasetContent) -> None:
    version = package_version()
    submaps = [
        PlacedSubmap(submap.grid, T_world_map, cut.robot, cut.stop - 1)
        for cut, submap, T_world_map in zip(content.cuts, content.submaps, content.truth.T_world_map, strict=True)
    ]
    attachments = {
        "config.json": (json.dumps(to_plain_dict(content.config), indent=1) + "\n").encode(),
        "truth.json": (folder / "truth.json").read_bytes(),
        **content.source.files,
    }
    metadata = {
        "generator": "mapmerge-bench",
        "version": version,
        "name": content.name,
        "seed": str(content.config.seed),
        **content.source.provenance,
    }
    recording = Recording(content.source.runs, submaps, content.source.ground_truth, attachments, metadata)
    write_recording(folder / "recording.mcap", recording, f"mapmerge-bench {version}")


def _write_pictures(folder: Path, content: DatasetContent) -> None:
    building = content.source.ground_truth
    draw_world(folder / "world.png", building, [run.trajectory for run in content.source.runs])
    draw_overview(folder / "overview.png", building, [s.grid for s in content.submaps], content.truth.T_world_map)


def _write_card(folder: Path, content: DatasetContent) -> None:
    write_card(folder / "README.md", content.name, content.config, content.source, content.truth)
