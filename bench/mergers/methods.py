"""Methods by name, and one call of a method on one dataset: maps in, ``result.json`` out, truth never shown."""

import dataclasses
import functools
import importlib.metadata
import json
import time
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from bench.cell import MethodKind, MethodSpec, Outcome, Setting
from bench.mergers import external
from bench.mergers.fork_server import Skipped
from bench.mergers.isolation import Limits, run_isolated
from bench.mergers.map_cache import read_cached_maps
from bench.mergers.reference_workload import recent_reference
from bench.mergers.servers import Preload
from bench.mergers.workspace import make_workspace
from merger.files.result_json import to_json_dict
from merger.grid_map import GridMap
from merger.pipeline import MergeConfig, merge_maps
from merger.result import MergeResult, Method

ENTRY_POINTS = "mapmerge_bench.methods"
"""Group of entry points: each a function ``(maps: list[GridMap], seed: int)`` that gives a `MergeResult`, or the
dictionary that ``result.json`` is to hold."""
PythonMethod = Callable[[Sequence[GridMap], int], MergeResult | Mapping[str, Any]]
"""What an entry point gives."""


@functools.cache
def python_methods() -> dict[str, importlib.metadata.EntryPoint]:
    """The installed Python methods, by name."""
    return {point.name: point for point in importlib.metadata.entry_points(group=ENTRY_POINTS)}


def merge_config(method: str, seed: int, workers: int, options: Sequence[tuple[str, Setting]]) -> MergeConfig:
    """Settings of one of our own methods.

    Args:
        method: Name of the method.
        seed: Its seed.
        workers: Threads.
        options: Dotted keys of `MergeConfig` and their values, as ``("ransac.min_inliers", 6)``.

    Raises:
        ValueError: an unknown key, or a value that the config refuses.
    """
    config = MergeConfig(method=Method(method), seed=seed, workers=workers)
    for key, value in options:
        config = _replace(config, key.split("."), value, key)
    return config


def preload_of(spec: MethodSpec) -> Preload:
    """What a process must have imported to run a method at once."""
    bare = spec.kind is MethodKind.EXTERNAL and external.SCANS not in spec.target
    return Preload.NOTHING if bare else Preload.METHODS


def run_method(spec: MethodSpec, maps: Sequence[Path], seed: int, out: Path, cache: Path) -> Outcome:
    """Run a method on maps, in a process of its own; it writes ``out/result.json``.

    Args:
        spec: The method.
        maps: YAML files of the maps, in order.
        seed: Seed of the method.
        out: An existing folder.
        cache: Folder of `bench.mergers.map_cache` with these maps; it need not be there.
    """
    limits = Limits(spec.time_limit_s, spec.memory_limit_mb)
    if spec.kind is not MethodKind.EXTERNAL:
        outcome = run_isolated(call_method, (spec, maps, seed, out, cache), limits, preload_of(spec))
    else:
        with make_workspace(out) as work:
            outcome = run_isolated(external.call_command, (spec.target, maps, work), limits, preload_of(spec))
    return dataclasses.replace(outcome, reference_s=recent_reference()) if outcome.status == "ok" else outcome


def call_method(spec: MethodSpec, paths: Sequence[Path], seed: int, out: Path, cache: Path) -> dict[str, Any]:
    """Run a method of ours, or an installed one, on maps in this process, and write ``out/result.json``.

    Returns:
        Fields of the `Outcome`.

    Raises:
        Exception: whatever the method raises.
    """
    maps = read_cached_maps(paths, cache)
    start, start_cpu = time.perf_counter(), time.process_time()
    result = _merge(spec, maps, seed)
    fields = {"wall_s": time.perf_counter() - start, "cpu_s": time.process_time() - start_cpu}
    document = to_json_dict(result) if isinstance(result, MergeResult) else result
    (out / "result.json").write_text(json.dumps(document), encoding="utf-8")
    return fields


def ordered_maps(dataset: Path, order: int) -> list[Path]:
    """The YAML files of a dataset's maps: by name, or shuffled by the order's number."""
    paths = sorted((dataset / "maps").glob("*.yaml"))
    if order == 0:
        return paths
    rng = np.random.default_rng(np.random.SeedSequence(order))
    return [paths[k] for k in rng.permutation(len(paths))]


def _merge(spec: MethodSpec, maps: list[GridMap], seed: int) -> MergeResult | Mapping[str, Any]:
    if spec.kind is MethodKind.MERGER:
        return merge_maps(maps, merge_config(spec.target, seed, spec.workers, spec.options))
    point = python_methods().get(spec.target)
    if point is None:
        raise Skipped(f"no Python method '{spec.target}' is installed")
    method: PythonMethod = point.load()
    return method(maps, seed)


def _replace(config: Any, path: list[str], value: Setting, key: str) -> Any:
    """A config with one nested field replaced."""
    name, rest = path[0], path[1:]
    hints = typing.get_type_hints(type(config))
    if name not in hints:
        raise ValueError(f"unknown key '{key}': {type(config).__name__} has {', '.join(sorted(hints))}")
    new = _replace(getattr(config, name), rest, value, key) if rest else _convert(value, hints[name], key)
    return dataclasses.replace(config, **{name: new})


def _convert(value: Setting, hint: Any, key: str) -> Any:
    """A plain value as the type that a field wants."""
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for kind in kinds:
        if value is None and kind is type(None):
            return None
        if isinstance(kind, type) and issubclass(kind, Enum):
            return kind(value)
        if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
        if isinstance(kind, type) and type(value) is kind:
            return value
    raise ValueError(f"'{key}' must be {hint}, got {value!r}")
