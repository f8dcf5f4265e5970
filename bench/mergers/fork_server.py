"""A small program from which calls are forked: it has already imported what they need, so a call costs milliseconds.

It runs in a session of its own and outlives whoever asks, to clean up: what a call leaves behind, its grandchildren in
sessions of their own included, becomes the server's child and is killed; when nobody is left to ask, all of it is.
Nothing of ours is imported here but what a call needs: its memory is copied for every call.
"""

import contextlib
import gc
import importlib
import os
import resource
import select
import signal
import socket
import struct
import sys
import traceback
from collections.abc import Callable, Iterable
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from bench.mergers.lifeline import adopt_orphans, children_of, die_with_parent, end_family, kill
from bench.mergers.workspace import remove_workspaces
from bench.one_line import one_line

STATUS = struct.Struct("i")
"""What the server says of a call on its status pipe: first the process's id, then how it ended (negative: a signal)."""
READY = b"r"
"""What it says when it has imported everything."""

Answer = tuple[str, str | None, dict[str, Any]]
"""Status, reason and fields of an outcome."""


class Skipped(Exception):  # noqa: N818  # it is no error, it is an answer
    """Raised by a call that cannot run here, because something optional is missing; the message says what."""


class Failed(Exception):  # noqa: N818  # as above
    """Raised by a call that gives no answer; the message is the whole reason."""


def serve(control_fd: int, modules: Iterable[str]) -> None:
    """Import modules, then fork a process for every call, until nobody is left to ask.

    Args:
        control_fd: A Unix socket. Each message brings two file descriptors: a socket on which the call is received and
            answered (`multiprocessing.connection`), and a pipe for `STATUS`.
        modules: What is imported first; what is not installed is left out.
    """
    asker = os.getppid()
    adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in modules:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.freeze()  # a collection in a call would touch, and so copy, all that was imported
    with socket.socket(fileno=control_fd) as control, contextlib.suppress(ConnectionError):  # nobody is left to ask
        control.send(READY)
        _serve_calls(control)
    end_family()
    remove_workspaces(asker)


def _serve_calls(control: socket.socket) -> None:
    ended, statuses = _wake_when_children_end(), dict[int, int]()
    while True:
        ready, _, _ = select.select([control.fileno(), ended], [], [])
        if ended in ready:
            os.read(ended, 4096)
            _report_ends(statuses)
        if control.fileno() in ready:
            _, fds, _, _ = socket.recv_fds(control, 1, 2)
            if not fds:
                return
            call_fd, status_fd = fds
            pid = _fork_call(call_fd, [status_fd, control.fileno(), *statuses.values()])
            statuses[pid] = status_fd
            _say(status_fd, pid)


def _wake_when_children_end() -> int:
    """A pipe that can be read when a child has ended."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    return reader


def _fork_call(call_fd: int, others: list[int]) -> int:
    """Fork a process for a call, which keeps none of the other file descriptors."""
    server = os.getpid()
    pid = os.fork()
    if pid == 0:
        for fd in others:
            os.close(fd)
        _run_call(call_fd, server)
    os.close(call_fd)
    return pid


def _report_ends(statuses: dict[int, int]) -> None:
    """Tell how calls ended, and kill what they left behind."""
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status_fd = statuses.pop(ended[0], None)
            if status_fd is not None:
                _say(status_fd, os.waitstatus_to_exitcode(ended[1]))
                os.close(status_fd)
    kill([pid for pid in children_of(os.getpid()) if pid not in statuses])


def _say(status_fd: int, number: int) -> None:
    with contextlib.suppress(BrokenPipeError):
        os.write(status_fd, STATUS.pack(number))


def _run_call(call_fd: int, server: int) -> NoReturn:
    """One call, in a process, a session and a family of its own."""
    code = 1
    try:
        os.setsid()
        die_with_parent()
        adopt_orphans()
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGCHLD, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)
        if os.getppid() == server:
            connection = Connection(call_fd)
            connection.send(_answer(connection))
            code = 0
    except SystemExit as ending:
        code = ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    except BaseException:  # noqa: BLE001  # said, and then this process ends
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _answer(connection: "Connection[Any, Any]") -> Answer:
    try:
        call: tuple[Callable[..., dict[str, Any] | None], tuple[Any, ...]] = connection.recv()
        fields = call[0](*call[1]) or {}
        own_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        return "ok", None, {"peak_memory_mb": own_mb} | fields
    except Skipped as reason:
        return "skipped", one_line(str(reason)), {}
    except Failed as reason:
        return "failed", str(reason), {}
    except MemoryError:
        return "failed", "out of memory", {}
    except Exception as error:  # noqa: BLE001  # whatever a method raises is its answer
        return "failed", one_line(f"{type(error).__name__}: {error}"), {}
