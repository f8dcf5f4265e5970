"""What is measured: a dataset, a method, a seed and an order of the maps make one cell, one row of the scores."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # large, and whoever runs a method does without
    from sim.config import SimConfig

Setting = bool | int | float | str | None
"""A value of a configuration key."""


class MethodKind(StrEnum):
    """How a method is called."""

    MERGER = "merger"
    """A method of our own package, with options."""
    PYTHON = "python"
    """A function announced in the entry point group ``mapmerge_bench.methods``."""
    EXTERNAL = "external"
    """A command."""


@dataclass(frozen=True)
class MethodSpec:
    """A method as it is called: what its answers are keyed by."""

    label: str
    """Name in the tables."""
    kind: MethodKind
    """How it is called."""
    target: str
    """The merger's method, the entry point, or the command with ``{maps}`` and ``{out}``."""
    options: tuple[tuple[str, Setting], ...] = ()
    """Dotted keys of `merger.merge_config.MergeConfig` and their values (kind ``merger`` only)."""
    workers: int = 1
    """Threads that a method of our own may use."""
    time_limit_s: float = 600.0
    """Seconds after which it is stopped."""
    memory_limit_mb: float = 8192.0
    """Resident memory, MiB, at which it is stopped."""

    def __post_init__(self) -> None:
        """Refuse limits that nothing could keep."""
        for name in ("time_limit_s", "memory_limit_mb", "workers"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class DatasetSpec:
    """A dataset as it is made: what it is keyed by, and what the tables call it."""

    label: str
    """Name in the tables."""
    config: "SimConfig"
    """What makes it, seed included."""
    swept: tuple[tuple[str, Setting], ...] = ()
    """Keys that this sweep varies, with this dataset's values: columns of the scores, no part of the dataset's key."""


@dataclass(frozen=True)
class Cell:
    """One row of the scores."""

    dataset: DatasetSpec
    """What is merged."""
    method: MethodSpec
    """By what."""
    seed: int
    """Seed of the dataset and of the method."""
    order: int = 0
    """0: the maps in order of their names; k: their k-th random order."""


@dataclass(frozen=True)
class Outcome:
    """How a method's call ended."""

    status: str
    """``ok``, ``failed`` or ``skipped``."""
    reason: str | None = None
    """Why it did not end well, in one line."""
    wall_s: float = float("nan")
    """Seconds that the method took, reading and writing files not included for our own."""
    peak_memory_mb: float = float("nan")
    """Largest resident memory, MiB."""
    cpu_s: float = float("nan")
    """Processor seconds that the method took, all its threads and processes together."""
    reference_s: float = float("nan")
    """Processor seconds of the reference workload, run in the same ten seconds."""
    overhead_s: float = float("nan")
    """Seconds that calling the method took besides, see `bench.scoring.score_rows.Score.runtime_overhead_s`."""


def hash_of(document: object) -> str:
    """Twenty hexadecimal digits that name a document of plain values, whatever the order of its keys."""
    text = json.dumps(document, sort_keys=True, default=_plain, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"no plain value: {value!r}")
