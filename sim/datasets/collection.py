"""Many datasets in one folder, with an index; whatever is finished is not made again."""

import csv
import io
import os
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from sim.config import SimConfig, building_name, dataset_name, to_plain_dict
from sim.datasets.dataset import Progress, make_dataset
from sim.datasets.dataset_folder import (
    INDEX,
    DatasetError,
    file_sha256,
    read_index,
    refuse_to_overwrite,
    remove_leftovers,
)
from sim.maps.truth import Truth, read_truth
from sim.version import package_version

TABLE = "collection.csv"
"""The index of a collection."""
_WATCH_S = 0.2


@dataclass(frozen=True)
class CollectionItem:
    """One dataset of a collection."""

    label: str
    """Name of its folder."""
    config: SimConfig
    """What makes it."""
    parameters: Mapping[str, str]
    """What distinguishes it: the swept keys and their values."""


def make_collection(items: Sequence[CollectionItem], out: Path, *, workers: int, progress: Progress) -> dict[str, str]:
    """Make every dataset that is not there yet, and write ``collection.csv`` after each.

    The result does not depend on the number of workers, nor on interruptions. The table has one row a dataset, in the
    order of the items: ``folder``, ``status`` (``made``, ``missing``, ``failed``), ``reason``, the swept keys,
    ``name``, ``seed``, ``world``, ``num_maps``, ``num_robots``, ``overlap_mean`` (over ordered pairs of maps),
    ``overlap_best_min`` (the smallest of the maps' largest overlaps), ``distortion_mean_m``, ``distortion_max_m``,
    ``duration_s``, ``sha256`` (of ``dataset.json``, and so of everything).

    Args:
        items: The datasets; labels are unique.
        out: Folder of the collection; each dataset gets a folder in it.
        workers: Processes, >= 1.
        progress: Called when it begins, and after each dataset that is there or cannot be made.

    Returns:
        For each dataset that could not be made, by label: why.

    Raises:
        DatasetError: a folder of the collection holds something else than the dataset that belongs there.
    """
    todo = [item for item in items if not _is_finished(item, out)]
    out.mkdir(parents=True, exist_ok=True)
    for item in items:
        remove_leftovers(out / item.label)
    progress("datasets", len(items) - len(todo), len(items))
    rows = {item.label: _row(item, out, None) for item in items}
    _write_table(rows, out)
    faults: dict[str, str] = {}
    for done, (item, fault) in enumerate(_make_all(todo, out, workers), start=len(items) - len(todo) + 1):
        if fault is not None:
            faults[item.label] = fault
        rows[item.label] = _row(item, out, fault)
        _write_table(rows, out)
        progress("datasets", done, len(items))
    for item in items:
        remove_leftovers(out / item.label)
    return faults


def _is_finished(item: CollectionItem, out: Path) -> bool:
    folder = out / item.label
    refuse_to_overwrite(folder)
    if not (folder / INDEX).is_file():
        return False
    index = read_index(folder)
    if index["config"] != to_plain_dict(item.config) or index["version"] != package_version():
        raise DatasetError(f"{folder}: made with another configuration or version; name another folder with out=")
    return True


def _row(item: CollectionItem, out: Path, fault: str | None) -> dict[str, Any]:
    """One line of the table."""
    folder, config = out / item.label, item.config
    row: dict[str, Any] = {"folder": item.label, "status": "missing", "reason": "", **item.parameters}
    row |= {"name": dataset_name(config), "seed": config.seed, "world": building_name(config)}
    if fault is not None:
        row |= {"status": "failed", "reason": fault}
    elif (folder / INDEX).is_file():
        row |= {"status": "made", **_measures(read_truth(folder / "truth.json")), "sha256": file_sha256(folder / INDEX)}
    return row


def _measures(truth: Truth) -> dict[str, str | int]:
    """What the table says of a dataset's maps."""
    count = len(truth.names)
    others = truth.overlap[~np.eye(count, dtype=np.bool_)].reshape(count, -1)
    return {
        "num_maps": count,
        "num_robots": len(set(truth.robot)),
        "overlap_mean": f"{others.mean() if others.size else 0.0:.4f}",
        "overlap_best_min": f"{others.max(axis=1).min() if others.size else 0.0:.4f}",
        "distortion_mean_m": f"{truth.distortion_rms_m.mean():.4f}",
        "distortion_max_m": f"{truth.distortion_rms_m.max():.4f}",
        "duration_s": f"{truth.end_s.max() - truth.start_s.min():.1f}",
    }


def _write_table(rows: Mapping[str, Mapping[str, Any]], out: Path) -> None:
    """Write the rows whole, the widest row's columns first."""
    columns = dict.fromkeys(key for row in sorted(rows.values(), key=len, reverse=True) for key in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, list(columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows.values())
    temporary = out / f".{TABLE}.tmp"
    temporary.write_text(text.getvalue(), encoding="utf-8")
    temporary.replace(out / TABLE)


def _make_all(items: Sequence[CollectionItem], out: Path, workers: int) -> Iterator[tuple[CollectionItem, str | None]]:
    """Make datasets, one process each, and yield them as they are finished."""
    if workers == 1 or len(items) < 2:
        for item in items:
            yield item, _make_one(item, out)
        return
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_die_with_parent, initargs=(os.getpid(),)) as pool:
        running: dict[Future[str | None], CollectionItem] = {pool.submit(_make_one, i, out): i for i in items}
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield running.pop(future), _result(future)


def _result(future: Future[str | None]) -> str | None:
    try:
        return future.result()
    except BrokenExecutor:
        raise DatasetError("a worker process died (out of memory?); start again to finish the collection") from None


def _make_one(item: CollectionItem, out: Path) -> str | None:
    """Make a dataset; returns why it cannot be made."""
    try:
        make_dataset(item.config, out / item.label)
    except (ValueError, OSError, MemoryError) as error:
        return " ".join(str(error).split()) or type(error).__name__
    return None


def _die_with_parent(parent: int) -> None:
    """End this worker soon after its parent has been killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
