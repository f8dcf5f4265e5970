"""Run a function in a process of its own: a crash, a hang or a flood of memory becomes a record with a reason.

Processes are forked from a small server that has already imported what methods need, so that a call costs
milliseconds, not the second that importing takes. A child dies with the program that asked for it.
"""

import contextlib
import multiprocessing
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import connection
from multiprocessing.context import ForkServerProcess
from typing import Any

import psutil

from bench.cell import Outcome
from bench.mergers.lifeline import die_with_parent, die_with_reader, outlive_reader

_POLL_S = 0.25
"""Between two looks at a child's memory and time; an answer is met at once."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_ADDED = "MAPMERGE_BENCH_ADDED"
_CONTEXT = multiprocessing.get_context("forkserver")
_START = threading.Lock()
_READY = threading.Event()


@dataclass(frozen=True)
class Limits:
    """What a call may use."""

    time_s: float
    """Seconds, greater than 0."""
    memory_mb: float
    """Resident memory of the whole process tree, MiB, greater than 0."""


class Skipped(Exception):  # noqa: N818  # it is no error, it is an answer
    """Raised by a call that cannot run here, because something optional is missing; the message says what."""


def warm_up(modules: list[str]) -> None:
    """Name the modules that calls will need; imported once, by the server, before the first call."""
    _CONTEXT.set_forkserver_preload(modules)


def start_server() -> None:
    """Start the server unless it runs, and wait until it is ready; linear algebra uses one thread in its calls.

    Threads that wait for each other on a busy machine burn processor time and change no result. Programs that a method
    starts find the environment as it was, see `original_environment`.
    """
    with _START:
        if _READY.is_set():
            return
        added = [name for name in _THREADS if name not in os.environ]
        os.environ.update(dict.fromkeys(added, "1") | {_ADDED: ",".join(added)})
        try:
            process = _CONTEXT.Process(target=int)
            process.start()
        finally:
            for name in (*added, _ADDED):
                del os.environ[name]
        process.join()
        _READY.set()


def original_environment() -> dict[str, str]:
    """This process's environment without what `start_server` added to it."""
    added = os.environ.get(_ADDED, "").split(",")
    return {name: value for name, value in os.environ.items() if name not in (*added, _ADDED)}


def run_isolated(function: Callable[..., dict[str, Any] | None], arguments: tuple[Any, ...], limits: Limits) -> Outcome:
    """Call a function in a fresh process.

    Args:
        function: A module-level function; the dictionary that it may return gives fields of the outcome.
        arguments: Its arguments, picklable.
        limits: When to stop it.

    Returns:
        Status ``ok``; ``skipped`` if it raised `Skipped`; else ``failed`` with the reason: the exception, the signal
        that ended it, or the limit that it broke.
    """
    start_server()
    receiver, sender = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=_child, args=(sender, function, arguments), daemon=False)
    with _START:
        process.start()
    sender.close()
    start = time.monotonic()
    answer = None
    try:
        breach, polled_mb = _watch(process, receiver, limits, start)
        answer = None if breach else _receive(receiver)
    finally:
        _end(process, wait=answer is None)
        receiver.close()
    if breach:
        return Outcome("failed", breach, time.monotonic() - start, polled_mb)
    if answer is None:
        return Outcome("failed", _death(process.exitcode), time.monotonic() - start, polled_mb)
    status, reason, fields = answer
    fields.setdefault("wall_s", time.monotonic() - start)
    fields["peak_memory_mb"] = max(
        fields.get("peak_memory_mb", 0.0), polled_mb if "peak_memory_mb" not in fields else 0.0
    )
    return Outcome(status, reason, **fields)


def _child(sender: connection.Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    os.setsid()
    die_with_parent()
    die_with_reader(sender)
    answer: tuple[str, str | None, dict[str, Any]]
    try:
        fields = function(*arguments) or {}
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        answer = ("ok", None, {"peak_memory_mb": own} | fields)
    except Skipped as reason:
        answer = ("skipped", str(reason), {})
    except MemoryError:
        answer = ("failed", "out of memory", {})
    except Exception as error:  # noqa: BLE001  # whatever a method raises is its answer
        answer = ("failed", _one_line(f"{type(error).__name__}: {error}"), {})
    outlive_reader(sender)
    sender.send(answer)
    sender.close()


def _watch(
    process: ForkServerProcess, receiver: connection.Connection, limits: Limits, start: float
) -> tuple[str | None, float]:
    """Wait until the child answers or dies; the limit it broke, if any, and the largest memory seen."""
    peak_mb = 0.0
    while not connection.wait([receiver, process.sentinel], timeout=_POLL_S):
        peak_mb = max(peak_mb, _memory_mb(process.pid))
        if time.monotonic() - start > limits.time_s:
            return f"time limit of {limits.time_s:g} s", peak_mb
        if peak_mb > limits.memory_mb:
            return f"memory limit of {limits.memory_mb:g} MiB (had {peak_mb:.0f})", peak_mb
    return None, peak_mb


def _memory_mb(pid: int | None) -> float:
    total = 0
    with contextlib.suppress(psutil.Error):
        root = psutil.Process(pid)
        for member in [root, *root.children(recursive=True)]:
            with contextlib.suppress(psutil.Error):
                total += member.memory_info().rss
    return total / 2**20


def _receive(receiver: connection.Connection) -> Any:
    try:
        return receiver.recv()
    except (EOFError, OSError):
        return None


def _end(process: ForkServerProcess, *, wait: bool) -> None:
    """Kill a child and its session; one that has answered has nothing left to do, and nobody waits for its end."""
    if wait:
        process.join(timeout=1.0)
    if process.pid is not None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    if wait:
        process.join(timeout=10.0)


def _death(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        return f"crashed with {signal.Signals(-exit_code).name}"
    return f"ended without an answer (exit status {exit_code})"


def _one_line(text: str) -> str:
    return " ".join(text.split())[:500]
