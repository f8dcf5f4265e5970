"""The keys and groups of ``python -m sim``, for hydra; for the entry points only."""

import dataclasses
import os
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.config import SimConfig
from sim.hydra_schema import group_choices, register, register_choice
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.sensors.lidar_presets import LIDAR_PRESETS

ROOT = "sim"
"""Name of the root config, ``conf/sim.yaml``."""
GROUPS = ("preset", "source", "robot", "lidar", "noise", "mapping")
"""Keys that choose a file of ``conf/KEY/``."""


@dataclass(frozen=True)
class RunConfig:
    """Keys that only concern a run of the command, not what it makes."""

    out: str | None = None
    """Folder to write; none: ``out/NAME``, or ``out/collection``."""
    workers: int | None = None
    """Threads for one dataset, processes for a collection, >= 1; none: one for each processor. The result does not
    depend on it."""
    quiet: bool = False
    """No progress."""

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        if self.workers is not None and self.workers < 1:
            raise ValueError(f"workers must be >= 1, got {self.workers}")

    @property
    def num_workers(self) -> int:
        """As many as are asked for, else as many as there are processors to run on."""
        allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        return self.workers or allowed or 1


@dataclass(frozen=True)
class _Root(SimConfig, RunConfig):
    """All keys of the command line."""


def register_schema() -> None:
    """Make the keys known to hydra, as ``sim_schema``, and the choices that are tables in the code."""
    register("sim_schema", _Root)
    for name, lidar in LIDAR_PRESETS.items():
        register_choice("lidar", name, lidar)
    for name, noise in NOISE_PRESETS.items():
        register_choice("noise", name, noise)


def usage(conf: Path) -> str:
    """The help text: groups with their choices, and every key with its default."""
    lines = [
        "python -m sim key=value ...          write a dataset to out=DIR",
        "python -m sim -m key=a,b,... ...     write a collection to out=DIR: sweeps a,b,c or range(0,100)",
        "python -m sim check DIR ...          verify datasets",
        "python -m sim manifest DIR           print what must come out when the dataset is made again",
        "python -m sim compare DIR MANIFEST   is a dataset as its manifest (conf/preset/NAME.json) says?",
        "",
        "Groups (key=choice):",
        *(f"  {group}={'|'.join(group_choices(conf, group))}" for group in GROUPS),
        "",
        "Keys (key=value; defaults before groups):",
        *(f"  {key}={value}" for key, value in _leaves("", _Root())),
    ]
    return "\n".join(lines)


def _leaves(prefix: str, config: Any) -> list[tuple[str, Any]]:
    """Every key and its default."""
    leaves: list[tuple[str, Any]] = []
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            leaves += _leaves(f"{prefix}{field.name}.", value)
        else:
            leaves.append((prefix + field.name, typing.cast(Any, getattr(value, "name", value))))
    return leaves
