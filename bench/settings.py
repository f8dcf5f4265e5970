"""The keys of ``python -m bench`` that concern the bench itself; all others make the dataset (`sim.config`)."""

from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

from bench.cell import Setting

OWN_METHODS = ("paper", "robust", "sequential")
"""Methods of our own package."""
MOST = 1_000_000
"""Seeds, or orders, of one run."""
TABLES = ("summary", "table1", "table2", "ablation", "fidelity", "robust")
"""Tables that a report can begin with."""


@dataclass(frozen=True)
class MethodSettings:
    """One method from the command line: ``method=external method.command='prog {maps} {out}'``."""

    name: str | None = None
    """What is run, in place of ``methods``; also its name in the tables."""
    command: str | None = None
    """The command of an external method; ``{maps}`` and ``{out}`` are replaced by folders."""


@dataclass(frozen=True)
class VariantSettings:
    """A method with some of its settings changed: an ablation."""

    method: str = "paper"
    """The method that is changed."""
    set: dict[str, Setting] = field(default_factory=dict)
    """Dotted keys of `merger.merge_config.MergeConfig` and their values."""


@dataclass(frozen=True)
class DatasetSettings:
    """A dataset of an experiment, by the overrides that one would type behind ``python -m sim``."""

    overrides: list[str] = field(default_factory=list)
    """For example ``[world=intel, submaps.count=8]``."""
    log: str | None = None
    """For real data: the log's name in the folder ``logs``; without that folder the dataset is left out."""


@dataclass(frozen=True)
class BenchSettings:
    """What is run, and how.

    Raises:
        ValueError: a number is out of its range, or the table is unknown.
    """

    title: str = "One dataset"
    """Heading of the report."""
    table: str = "summary"
    """What is printed first: one of summary, table1, table2, ablation, fidelity, robust."""
    datasets: dict[str, Any] = field(default_factory=dict)
    """`DatasetSettings` by name; none: one, made by the other keys of the command line."""
    all_logs: bool = False
    """Whether every log in ``logs`` becomes a dataset."""
    log_overrides: list[str] = field(default_factory=list)
    """Overrides of every dataset that is cut from a log."""
    sweep: dict[str, Any] = field(default_factory=dict)
    """Keys of ``python -m sim`` and the list of values that each takes; every combination is run."""
    hard_is_high: dict[str, bool] = field(
        default_factory=lambda: {"submaps.overlap": False, "submaps.measured_overlap": False}
    )
    """By swept key: whether its larger values are the harder ones, as breaking points need; true unless said."""
    methods: list[str] = field(default_factory=lambda: ["paper"])
    """Methods: ours, variants, installed Python methods, ``external``."""
    method: MethodSettings = field(default_factory=MethodSettings)
    """One method in place of ``methods``."""
    variants: dict[str, Any] = field(default_factory=dict)
    """`VariantSettings` by name."""
    orders: int = 0
    """0: the maps by name; k: k random orders of each dataset, at most a million."""
    seed: int = 0
    """First seed, at least 0."""
    seeds: int = 1
    """Seeds a dataset, 1 to a million; each makes its own data and seeds the method."""
    out: str | None = None
    """Folder of results; none: ``out/EXPERIMENT``."""
    logs: str | None = None
    """Folder of real CARMEN logs: ``NAME.log``, ``NAME.log.gz`` or ``NAME-corrected.log.gz``."""
    workers: int | None = None
    """Cells run at a time, at least 1; none: one for each of the machine's cores."""
    method_workers: int = 1
    """Threads of one of our own methods, at least 1."""
    time_limit_s: float = 600.0
    """Seconds after which a method is stopped."""
    memory_limit_mb: float = 8192.0
    """Resident memory at which a method is stopped, MiB."""
    retry_failed: bool = False
    """Whether cells that failed are run again."""
    quiet: bool = False
    """Whether to say nothing but errors."""

    def __post_init__(self) -> None:
        """Refuse numbers out of range, and a table that there is not."""
        if self.table not in TABLES:
            raise ValueError(f"table must be one of {', '.join(TABLES)}, got '{self.table}'")
        lowest = {"orders": 0, "seed": 0, "seeds": 1, "workers": 1, "method_workers": 1}
        for name, low in lowest.items():
            if (value := getattr(self, name)) is not None and value < low:
                raise ValueError(f"{name} must be >= {low}, got {getattr(self, name)}")
        for name in ("orders", "seeds"):
            if getattr(self, name) > MOST:
                raise ValueError(f"{name} must be <= {MOST}, got {getattr(self, name)}")
        for name in ("time_limit_s", "memory_limit_mb"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")


def read_settings(document: dict[str, Any]) -> BenchSettings:
    """Settings from plain values, as hydra composes them.

    Raises:
        ValueError: a dataset, variant or swept key is malformed, or a number is out of range.
    """
    values = dict(document)
    values["method"] = MethodSettings(**values.get("method", {}))
    values["datasets"] = {k: _record(DatasetSettings, f"datasets.{k}", v) for k, v in values["datasets"].items()}
    values["variants"] = {k: _record(VariantSettings, f"variants.{k}", v) for k, v in values["variants"].items()}
    for key, points in values["sweep"].items():
        if not isinstance(points, list) or not points:
            raise ValueError(f"sweep.{key} must be a list of values, got {points!r}")
    return BenchSettings(**values)


_T = TypeVar("_T", DatasetSettings, VariantSettings)


def _record(kind: type[_T], name: str, value: object) -> _T:
    known = [item.name for item in fields(kind)]
    if not isinstance(value, dict) or set(value) - set(known):
        raise ValueError(f"{name} must have only the keys {', '.join(known)}, got {value!r}")
    return kind(**value)
