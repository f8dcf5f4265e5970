"""The card of a dataset: what it is and how it was made, for a person."""

import math
from pathlib import Path

import numpy as np

from sim.command import make_command
from sim.config import SimConfig, SourceKind
from sim.maps.missed_overlaps import describe_missed
from sim.maps.submaps import SubmapsConfig
from sim.maps.truth import Truth
from sim.robot_run import LidarSpec
from sim.source import Source
from sim.version import package_version

_FILES = """\
| file | what it holds |
|---|---|
| `dataset.json` | name, seed, version, the whole configuration, SHA-256 of every file |
| `maps/map_NN.yaml`, `.pgm` | the submaps, in the format of ROS's `map_server`, each in a frame of its own |
| `truth.json` | the true place of each submap, its distortion, and how much the submaps overlap |
| `recording.mcap` | all scans, odometry, true poses, transforms and maps as ROS 2 messages (second 0 is stamp 10^9 s) |
| `scans.log` | the scans in CARMEN's format (PARAM, ODOM, TRUEPOS, FLASER) |
| `trajectories/ROBOT_truth.tum` | true poses in frame `world`, TUM format |
| `trajectories/ROBOT_odometry.tum` | poses by odometry, which begins at the robot's true start |
| `trajectories/ROBOT_estimate.tum` | poses with which the submaps were mapped, each submap at its true place |
| `world.png`, `overview.png` | the building with the robots' ways; the submaps laid over it |
"""
_POSES = {
    "truth": "the true ones, so that the submaps are not distorted",
    "odometry": "those of odometry alone, so that the submaps drift as it does",
    "scan_matched": "from matching scans to the growing map, starting from odometry, so that "
    "the submaps bend as a real robot's do",
}


def write_card(path: Path, name: str, config: SimConfig, source: Source, truth: Truth) -> None:
    """Write the card as Markdown.

    Args:
        path: The file to write.
        name: Name of the dataset.
        config: What made it.
        source: The runs and the building.
        truth: True places of the submaps.
    """
    parts = [
        f"# {name}",
        _what(config, source, truth),
        "## How it was made",
        _how(config, truth),
        f"```\n{make_command(config, name)}\n```",
        f"Version {package_version()} of mapmerge-bench; the same command and version give the same files.",
        "## Sensor",
        _sensor(source.runs[0].lidar),
        "## Submaps",
        _submaps_table(truth),
        "## Files",
        _FILES.rstrip(),
        "Motions are `T_a_b`: they map points of frame b into frame a; metres, radians, seconds since the run began.",
        "## Licence",
        _licence(config, source),
    ]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _what(config: SimConfig, source: Source, truth: Truth) -> str:
    width, height = source.ground_truth.size_m
    robots = len(source.runs)
    num_scans = sum(run.num_scans for run in source.runs)
    kind = "Simulated 2D lidar data" if config.source.kind is SourceKind.SIMULATED else "Real 2D lidar data"
    return (
        f"{kind} of the building `{source.building}` ({width:.0f} x {height:.0f} m): {num_scans} scans of "
        f"{robots} robot{'s' * (robots > 1)}, cut into {len(truth.names)} overlapping submaps, each in a frame of "
        "its own, with the true place of each. The task: find the motions between the submaps, and merge them into "
        "one map.\n\n"
        "![The submaps laid over the building](overview.png)"
    )


def _how(config: SimConfig, truth: Truth) -> str:
    if config.source.kind is SourceKind.SIMULATED:
        source = f"Robots drove through the world `{config.world}` in a physical simulation."
    else:
        source = f"The scans are those of the log `{Path(config.source.path or '').name}`; its poses are the truth."
    return (
        f"{source} The submaps were mapped at {config.mapping.occupancy.resolution_m:g} m. Their poses: "
        f"{_POSES[config.mapping.poses.value]}. {_cut(config.submaps, truth)}"
    )


def _cut(submaps: SubmapsConfig, truth: Truth) -> str:
    """How runs became submaps, and where that is not as it was asked for."""
    target = submaps.measured_overlap
    if target is None:
        return f"Neighbouring submaps of a robot share {submaps.overlap:.0%} of their scans."
    missed = describe_missed(truth, target)
    text = f"Runs were cut so that the maps of neighbouring submaps of a robot overlap by {target:g}"
    return f"{text}; no cut was found for {', '.join(missed)}." if missed else f"{text}."


def _sensor(lidar: LidarSpec) -> str:
    first, last = math.degrees(lidar.angle_min_rad), math.degrees(lidar.angle_max_rad)
    x_m, y_m, theta_rad = lidar.T_robot_lidar
    return (
        f"2D lidar, {lidar.num_beams} beams from {first:.1f} to {last:.1f} degrees "
        f"({math.degrees(lidar.angle_increment_rad):.3g} apart), ranges {lidar.range_min_m:g} to {lidar.range_max_m:g} "
        f"m, a scan every {lidar.scan_period_s:.3g} s, mounted at x {x_m:g} m, y {y_m:g} m, "
        f"{math.degrees(theta_rad):g} degrees on the robot."
    )


def _submaps_table(truth: Truth) -> str:
    """One row a submap; the overlap is the largest with any other."""
    others = truth.overlap - np.diag(np.diag(truth.overlap))
    lines = ["| map | robot | from s | to s | distortion (rms, m) | largest overlap |", "|---|---|---|---|---|---|"]
    for i, name in enumerate(truth.names):
        span = f"{truth.start_s[i]:.1f} | {truth.end_s[i]:.1f}"
        lines.append(
            f"| {name} | {truth.robot[i]} | {span} | {truth.distortion_rms_m[i]:.3f} | {others[i].max():.2f} |"
        )
    return "\n".join(lines)


def _licence(config: SimConfig, source: Source) -> str:
    if config.source.kind is SourceKind.SIMULATED:
        return "Simulated data: CC0 1.0, to be used for anything. The software that made it: Apache-2.0."
    log = f"`{source.provenance['log']}` (SHA-256 `{source.provenance['log_sha256']}`)"
    return f"The scans come from the log {log} and stay under the terms of those who recorded and published it."
