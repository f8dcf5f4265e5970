"""Where a dataset's scans come from: robots in a simulated building, or a log; after that all is the same."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from merger.grid_map import GridMap
from sim.carmen import read_carmen
from sim.config import SimConfig, SourceKind, building_name
from sim.robot_run import RobotRun
from sim.submap_mapping import map_ground_truth


@dataclass(frozen=True)
class Source:
    """The runs, and what is known of the place."""

    building: str
    """Name of the building or of the log."""
    runs: Sequence[RobotRun]
    """One for each robot."""
    ground_truth: GridMap
    """The true map of the building, in frame ``world``: drawn from its walls, or mapped at the true poses."""
    provenance: dict[str, str]
    """Facts for the card and the recording."""
    files: dict[str, bytes] = field(default_factory=dict)
    """What else belongs to the source, by file name: the world."""


def make_source(config: SimConfig) -> Source:
    """Simulate, or read the log.

    Raises:
        ValueError: the world or log cannot be used, or the configuration asks for the impossible.
    """
    if config.source.kind is SourceKind.CARMEN:
        return _read_log(config)
    raise ValueError("source=simulated: not built yet")


def _read_log(config: SimConfig) -> Source:
    path = Path(config.source.path or "")
    runs = read_carmen(path)
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    ground_truth = map_ground_truth(runs, config.mapping.occupancy)
    return Source(building_name(config), runs, ground_truth, {"log": path.name, "log_sha256": digest})
