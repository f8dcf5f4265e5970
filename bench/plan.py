"""From settings to cells: datasets x swept values x seeds x orders x methods, all named before any runs."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec, Setting
from bench.mergers.external import check_command
from bench.mergers.methods import merge_config, python_methods
from bench.mergers.shipped import SHIPPED, shipped_command
from bench.settings import OWN_METHODS, BenchSettings, DatasetSettings
from sim.config import SimConfig, SourceKind

ComposeSim = Callable[[Sequence[str]], SimConfig]
"""Overrides of ``python -m sim`` to its config; given by the entry point, which alone knows hydra."""

_SAID_ELSEWHERE = ("world", "source", "source.path", "name")
_LOG_SUFFIXES = ("-corrected.log.gz", "-corrected.log", ".log.gz", ".log")


def plan_cells(settings: BenchSettings, overrides: Sequence[str], compose: ComposeSim) -> list[Cell]:
    """Every cell of an experiment, in the order of its rows.

    Args:
        settings: The experiment.
        overrides: What the command line says about the dataset; it has the last word, over swept values, too.
        compose: Gives a dataset's config.

    Raises:
        ValueError: a method, a log or a key is unknown, or a config refuses its values.
    """
    methods = plan_methods(settings)
    datasets = plan_datasets(settings, overrides, compose)
    orders = range(1, settings.orders + 1) if settings.orders else (0,)
    seeds = range(settings.seed, settings.seed + settings.seeds)
    return [
        Cell(replace(spec, config=replace(spec.config, seed=seed)), method, seed, order)
        for spec, seed, order, method in itertools.product(datasets, seeds, orders, methods)
    ]


def plan_datasets(settings: BenchSettings, overrides: Sequence[str], compose: ComposeSim) -> list[DatasetSpec]:
    """The datasets of an experiment, before seeds."""
    logs = find_logs(Path(settings.logs)) if settings.logs else {}
    entries = dict(settings.datasets) or {"": DatasetSettings()}
    if settings.all_logs:
        used = {entry.log for entry in entries.values()}
        entries |= {f"{name}-real": DatasetSettings(log=name) for name in logs if name not in used}
    typed, said = _typed(overrides), {override.partition("=")[0] for override in overrides}
    sweep = {key: points for key, points in settings.sweep.items() if key not in said}
    specs = []
    for label, entry in entries.items():
        base = _entry_overrides(entry, logs, settings.log_overrides)
        if base is None:
            continue
        for point in itertools.product(*sweep.values()):
            swept = dict(zip(sweep, point, strict=True))
            config = compose([*base, *(f"{key}={_text(value)}" for key, value in swept.items()), *overrides])
            specs.append(DatasetSpec(label or _building(config), config, tuple((typed | swept).items())))
    return specs


def plan_methods(settings: BenchSettings) -> list[MethodSpec]:
    """The methods of an experiment."""
    names = [settings.method.name] if settings.method.name else settings.methods
    if not names:
        raise ValueError("methods must name at least one method")
    return [_method(name, settings) for name in names]


def find_logs(folder: Path) -> dict[str, Path]:
    """The CARMEN logs of a folder, by name.

    Raises:
        ValueError: there is no such folder, or it holds no log.
    """
    if not folder.is_dir():
        raise ValueError(f"logs: {folder}: no such folder")
    logs: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        suffix = next((s for s in _LOG_SUFFIXES if path.name.endswith(s)), None)
        if suffix:
            logs.setdefault(path.name.removesuffix(suffix), path)
    if not logs:
        raise ValueError(f"logs: {folder}: no NAME.log, NAME.log.gz or NAME-corrected.log.gz")
    return logs


def _entry_overrides(entry: DatasetSettings, logs: dict[str, Path], common: Sequence[str]) -> list[str] | None:
    """A dataset's own overrides; none where its log is not there."""
    if entry.log is None:
        return list(entry.overrides)
    if entry.log not in logs:
        return None
    path = str(logs[entry.log].absolute()).replace("\\", "\\\\").replace("'", "\\'")
    return ["source=carmen", f"source.path='{path}'", *common, *entry.overrides]


def _building(config: SimConfig) -> str:
    if config.source.kind is SourceKind.CARMEN:
        return Path(config.source.path or "").name.split(".")[0].removesuffix("-corrected")
    return Path(config.world).stem


def building_of(spec: DatasetSpec) -> str:
    """Name of the building that a dataset shows."""
    return _building(spec.config)


def _method(name: str, settings: BenchSettings) -> MethodSpec:
    kind, target, options = _call(name, settings)
    if kind is MethodKind.MERGER:
        try:
            merge_config(target, 0, 1, options)
        except ValueError as error:
            raise ValueError(f"method '{name}': {error}") from None
    return MethodSpec(
        label=name,
        kind=kind,
        target=target,
        options=options,
        workers=settings.method_workers,
        time_limit_s=settings.time_limit_s,
        memory_limit_mb=settings.memory_limit_mb,
    )


def _call(name: str, settings: BenchSettings) -> tuple[MethodKind, str, tuple[tuple[str, Setting], ...]]:
    if settings.method.command and name == (settings.method.name or "external"):
        check_command(settings.method.command)
        return MethodKind.EXTERNAL, settings.method.command, ()
    if name in settings.variants:
        variant = settings.variants[name]
        return MethodKind.MERGER, variant.method, tuple(sorted(variant.set.items()))
    if name in OWN_METHODS:
        return MethodKind.MERGER, name, ()
    if name in python_methods():
        return MethodKind.PYTHON, name, ()
    if name in SHIPPED:
        return MethodKind.EXTERNAL, shipped_command(name), ()
    if name == "external":
        raise ValueError("method=external needs method.command='prog {maps} {out}'")
    known = [*OWN_METHODS, *settings.variants, *sorted(python_methods()), *SHIPPED, "external"]
    raise ValueError(f"unknown method '{name}': there are {', '.join(known)}")


def _typed(overrides: Sequence[str]) -> dict[str, Setting]:
    """What was typed about the dataset, as columns."""
    pairs = (override.partition("=") for override in overrides)
    return {key: parse_value(value) for key, _, value in pairs if key not in _SAID_ELSEWHERE}


def parse_value(text: str) -> Setting:
    """A typed value as it stands in a column: a number, true or false, none, or text."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False, "null": None}.get(text.lower(), text.strip("'\""))


def _text(value: Setting) -> str:
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)
