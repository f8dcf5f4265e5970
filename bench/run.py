"""Run cells: several at a time, each in processes of its own, finished ones never twice."""

import functools
import os
import threading
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass

from bench.cell import Cell, DatasetSpec, Outcome
from bench.stages import CellKeys, ScoredCell, failed_cell, finish_dataset, finish_prediction, finish_score, keys_of
from bench.store import Store

CellProgress = Callable[[ScoredCell, int, int], None]
"""``progress(cell, done, total)`` is called, from any thread, as cells are finished."""


@dataclass(frozen=True)
class RunOptions:
    """How cells are run; no score depends on it."""

    workers: int | None = None
    """Cells at a time; none: as many as the machine that runs them gives us cores."""
    retry_failed: bool = False
    """Whether failures of earlier runs are tried again."""


def run_cells(
    cells: Sequence[Cell], store: Store, options: RunOptions, progress: CellProgress | None = None
) -> list[ScoredCell]:
    """Finish every cell.

    Args:
        cells: What is measured.
        store: Where finished stages lie.
        options: How to run.
        progress: Called as cells are finished.

    Returns:
        The finished cells, in the order given; a failure is a cell with its reason.
    """
    store.sweep_out()
    runner = _Runner(store, options, progress, len(cells))
    cores = len(os.sched_getaffinity(0))
    workers = options.workers or cores
    with ThreadPoolExecutor(max_workers=workers) as pool, ThreadPoolExecutor(max_workers=1) as scorer:
        spare = scorer if workers < cores else None
        futures = [pool.submit(runner.finish, cell, spare) for cell in cells]
        try:
            return [future.result().result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class _Runner:
    """Finishes single cells; datasets that several cells share are made by the first that comes."""

    def __init__(self, store: Store, options: RunOptions, progress: CellProgress | None, total: int) -> None:
        self._store, self._options, self._progress, self._total = store, options, progress, total
        self._done = 0
        self._lock = threading.Lock()
        self._locks: dict[str, threading.Lock] = defaultdict(threading.Lock)
        self._retried: set[str] = set()

    def finish(self, cell: Cell, spare: Executor | None) -> "Future[ScoredCell]":
        """One cell, from its dataset to its scores; on a spare core it is scored while the next method runs."""
        keys = keys_of(cell)
        made = self._make_dataset(cell.dataset, keys)
        if made.status != "ok":
            score = functools.partial(failed_cell, self._store, cell, keys, made)
        else:
            outcome = finish_prediction(self._store, cell, keys, self._options.retry_failed)
            score = functools.partial(finish_score, self._store, cell, keys, outcome, waited_for=spare is None)
        if spare:
            return spare.submit(self._report, score)
        done: Future[ScoredCell] = Future()
        done.set_result(self._report(score))
        return done

    def _report(self, score: Callable[[], ScoredCell]) -> ScoredCell:
        scored = score()
        with self._lock:
            self._done += 1
            if self._progress:
                self._progress(scored, self._done, self._total)
        return scored

    def _make_dataset(self, spec: DatasetSpec, keys: CellKeys) -> Outcome:
        key = keys.dataset
        with self._lock:
            lock = self._locks[key]
            retry = self._options.retry_failed and key not in self._retried
            self._retried.add(key)
        with lock:
            return finish_dataset(self._store, spec, keys, retry)
