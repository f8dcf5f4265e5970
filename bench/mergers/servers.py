"""The servers that calls are forked from, started once a program and shared by its threads.

A fork copies what the server has in memory, so there are several: each has imported what its calls need and no more.
The bare one, for other people's commands, is copied in a millisecond, and its memory is not taken for theirs.
"""

import os
import socket
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from enum import Enum
from multiprocessing.connection import Connection
from typing import Any

from bench.mergers.environment import server_environment
from bench.mergers.fork_server import READY


class Preload(Enum):
    """What a server has imported when it forks."""

    METHODS = ("bench.mergers.methods", "scipy.spatial", "bench.scoring.warm_kernels")
    """What our own methods need."""
    DATASETS = ("bench.stages", "bench.scoring.warm_kernels")
    """What making a dataset needs: much more, which no method shall carry."""
    NOTHING = ("bench.mergers.external",)
    """No more than it takes to start a command."""


@dataclass
class ForkServer:
    """A running server."""

    process: subprocess.Popen[bytes]
    """The server."""
    control: socket.socket
    """What it is asked through; it ends when this is closed, by whatever end of this program."""
    _ready: threading.Event = field(default_factory=threading.Event)
    _waiting: threading.Lock = field(default_factory=threading.Lock)

    def wait_until_ready(self) -> None:
        """Wait until it has imported everything.

        Raises:
            RuntimeError: it ended before.
        """
        with self._waiting:
            if not self._ready.is_set():
                if self.control.recv(1) != READY:
                    raise RuntimeError(f"the server of processes ended with status {self.process.wait()}")
                self._ready.set()

    def start_call(self) -> tuple["Connection[Any, Any]", int]:
        """Fork a process: the socket to send it a call and receive its answer, and the pipe of its status.

        Raises:
            OSError: the server is gone.
        """
        ours, theirs = socket.socketpair()
        reader, writer = os.pipe()
        try:
            socket.send_fds(self.control, [b"c"], [theirs.fileno(), writer])
        except OSError:
            ours.close()
            os.close(reader)
            raise
        finally:
            theirs.close()
            os.close(writer)
        return Connection(ours.detach()), reader


_SERVERS: dict[Preload, ForkServer] = {}
_START = threading.Lock()


def find_server(preload: Preload) -> ForkServer:
    """The server of this program, started unless it runs; it may still be importing."""
    with _START:
        known = _SERVERS.get(preload)
        if known is None or known.process.poll() is not None:
            _SERVERS[preload] = known = _start(preload)
        return known


def _start(preload: Preload) -> ForkServer:
    ours, theirs = socket.socketpair()
    with theirs:
        call = f"serve({theirs.fileno()}, {preload.value!r})"
        code = f"import sys; sys.path[:] = {sys.path!r}; from bench.mergers.fork_server import serve; {call}"
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL,
            env=server_environment(),
            pass_fds=[theirs.fileno()],
            start_new_session=True,  # it lives on when this program's group is killed, and cleans up
        )
    return ForkServer(process, ours)
