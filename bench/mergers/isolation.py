"""Run a function in a process of its own: a crash, a hang or a flood of memory becomes a record with a reason.

Processes are forked from a server (`bench.mergers.fork_server`) and die with the program that asked for them, and so
does all that they have started.
"""

import contextlib
import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from typing import Any

from bench.cell import Outcome
from bench.mergers.fork_server import STATUS
from bench.mergers.lifeline import family_of, kill
from bench.mergers.servers import Preload, find_server

_POLL_S = 0.25
"""Between two looks at a call's memory and time; an answer is met at once."""
_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2**20


@dataclass(frozen=True)
class Limits:
    """What a call may use."""

    time_s: float
    """Seconds, greater than 0."""
    memory_mb: float
    """Resident memory of the whole process tree, MiB, greater than 0."""


def run_isolated(
    function: Callable[..., dict[str, Any] | None],
    arguments: tuple[Any, ...],
    limits: Limits,
    preload: Preload = Preload.METHODS,
) -> Outcome:
    """Call a function in a fresh process.

    Args:
        function: A module-level function; the dictionary that it may return gives fields of the outcome.
        arguments: Its arguments, picklable.
        limits: When to stop it.
        preload: What the process has imported beforehand.

    Returns:
        Status ``ok``; ``skipped`` if it raised `bench.mergers.fork_server.Skipped`; else ``failed`` with the reason:
        the exception, the signal that ended it, or the limit that it broke.
    """
    server = find_server(preload)
    server.wait_until_ready()
    call, status_fd = server.start_call()
    start = time.monotonic()
    with call, os.fdopen(status_fd, "rb", buffering=0) as status:
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            call.send((function, arguments))
        pid = _read_number(status)
        breach, polled_mb = _watch(pid, [call, status], limits, start)
        answer = None if breach else _receive(call)
        if answer is None:
            exit_code = _end(pid, status, wait_s=0.0 if breach else 1.0)
            return Outcome("failed", breach or _death(exit_code), time.monotonic() - start, polled_mb)
    kind, reason, fields = answer
    fields.setdefault("wall_s", time.monotonic() - start)
    fields.setdefault("peak_memory_mb", polled_mb)
    return Outcome(kind, reason, **fields)


def _read_number(status: Any) -> int | None:
    """The next number on a call's status pipe; none when the server is gone."""
    data = status.read(STATUS.size)
    return STATUS.unpack(data)[0] if data else None


def _watch(pid: int | None, signs: list[Any], limits: Limits, start: float) -> tuple[str | None, float]:
    """Wait until the call answers or ends; the limit it broke, if any, and the largest memory seen."""
    peak_mb = 0.0
    while pid is not None and not connection.wait(signs, timeout=_POLL_S):
        peak_mb = max(peak_mb, sum(map(_memory_mb, family_of(pid))))
        if time.monotonic() - start > limits.time_s:
            return f"time limit of {limits.time_s:g} s", peak_mb
        if peak_mb > limits.memory_mb:
            return f"memory limit of {limits.memory_mb:g} MiB (had {peak_mb:.0f})", peak_mb
    return None, peak_mb


def _memory_mb(pid: int) -> float:
    """Resident memory of a process, MiB; 0 if it is gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_bytes().split()[1]) * _PAGE_MB
    except (OSError, IndexError):
        return 0.0


def _receive(call: "connection.Connection[Any, Any]") -> Any:
    """The answer; none if there is none, and will be none."""
    try:
        return call.recv() if call.poll(0) else None
    except (EOFError, OSError):
        return None


def _end(pid: int | None, status: Any, wait_s: float) -> int | None:
    """Kill a call that has not answered, unless it ends by itself; how it ended, none when the server is gone.

    What it has started is killed by the server.
    """
    if pid is None:
        return None
    if not connection.wait([status], timeout=wait_s):
        kill([pid])
    return _read_number(status)


def _death(exit_code: int | None) -> str:
    if exit_code is None:
        return "the server of processes was ended"
    if exit_code < 0:
        return f"crashed with {signal.Signals(-exit_code).name}"
    return f"ended without an answer (exit status {exit_code})"
