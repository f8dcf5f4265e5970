"""Processes that end with the one that asked for them, even if it is killed (Linux)."""

import contextlib
import ctypes
import fcntl
import os
import select
import signal
from multiprocessing import connection

_PR_SET_PDEATHSIG = 1


def die_with_parent() -> None:
    """Ask the kernel to end this process when its parent ends (Linux; elsewhere nothing happens)."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def die_with_reader(sender: connection.Connection) -> None:
    """Ask for SIGIO, which ends this process, when nobody is left to read its answer.

    The parent is the server, which lives as long as any of its children: its end would come too late.
    """
    fcntl.fcntl(sender.fileno(), fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(sender.fileno(), fcntl.F_SETFL, fcntl.fcntl(sender.fileno(), fcntl.F_GETFL) | os.O_ASYNC)
    poll = select.poll()
    poll.register(sender.fileno(), select.POLLERR)
    if poll.poll(0):
        os._exit(1)


def outlive_reader(sender: connection.Connection) -> None:
    """Undo `die_with_reader`: an answer that is being read gives the same signal."""
    fcntl.fcntl(sender.fileno(), fcntl.F_SETFL, fcntl.fcntl(sender.fileno(), fcntl.F_GETFL) & ~os.O_ASYNC)
