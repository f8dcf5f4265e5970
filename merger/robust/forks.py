"""The same work on many items in forked processes: threads would wait for one another at every short call.

What the work reads is there in a child without a copy; only the answers travel. A child has the parent's memory but not
its threads, so that whoever runs several, or lets OpenCV do so, gets threads instead, and the same answers.
"""

import multiprocessing
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from typing import TypeVar

import cv2

from merger.merge_config import Progress
from merger.stages import map_in_threads

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")


def map_in_forks(
    work: Callable[[_Item], _Answer], items: Sequence[_Item], workers: int, stage: str, progress: Progress
) -> list[_Answer]:
    """Do the same work on every item; the answers come in the items' order, whatever the number of processes.

    Args:
        work: What is done; it may read whatever the caller holds, and must return what can be pickled.
        items: What it is done on, costly ones first.
        workers: Processes, this one among them, at least 1.
        stage: What `progress` is told.
        progress: Told how many are done, by how far this process has come.

    Raises:
        RuntimeError: a process ended without an answer.
        Exception: whatever the work raises.
    """
    workers = min(workers, len(items))
    if workers < 2 or not _may_fork():
        return map_in_threads(work, items, max(workers, 1), stage, progress)
    children = [_start(work, items[first::workers]) for first in range(workers - 1)]
    try:
        own = map_in_threads(work, items[workers - 1 :: workers], 1, stage, _scaled(progress, len(items), workers))
        parts = [*(_receive(process, end) for process, end in children), own]
    finally:
        for process, _ in children:
            process.terminate()
            process.join()
    progress(stage, len(items), len(items))
    return [parts[number % workers][number // workers] for number in range(len(items))]


def _may_fork() -> bool:
    """Whether a child would be whole: Linux, no other threads, no process that may have no children."""
    alone = threading.active_count() == 1 and cv2.getNumThreads() <= 1
    return sys.platform == "linux" and alone and not multiprocessing.current_process().daemon


def _scaled(progress: Progress, total: int, workers: int) -> Progress:
    """Progress of all, told by that of one."""
    return lambda stage, done, _: progress(stage, min(done * workers, total - 1), total)


def _start(
    work: Callable[[_Item], _Answer], items: Sequence[_Item]
) -> tuple[multiprocessing.process.BaseProcess, Connection]:
    """A child at work, and where its answers come out."""
    context = multiprocessing.get_context("fork")
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(work, items, sending), daemon=True)
    process.start()
    sending.close()
    return process, receiving


def _answer(work: Callable[[_Item], _Answer], items: Sequence[_Item], end: Connection) -> None:
    """In the child: send all answers, or the first error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children
    try:
        end.send([work(item) for item in items])
    except Exception as error:  # noqa: BLE001  # whatever it is, the parent raises it
        end.send(error)


def _receive(process: multiprocessing.process.BaseProcess, end: Connection) -> list[_Answer]:
    """What a child has sent.

    Raises:
        RuntimeError: it ended without a word.
    """
    try:
        received = end.recv()
    except EOFError:
        process.join()
        raise RuntimeError(f"a process of the merge ended without an answer (exit code {process.exitcode})") from None
    if isinstance(received, Exception):
        raise received
    return list(received)
