"""Processes that end with the one that asked for them, and leave nobody behind (Linux; elsewhere nothing happens)."""

import contextlib
import ctypes
import os
import signal
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_PRCTL = getattr(ctypes.CDLL(None), "prctl", None)
"""Looked up once: every call that is forked would do it again."""


def die_with_parent() -> None:
    """Ask the kernel to end this process when its parent ends."""
    _control_process(_PR_SET_PDEATHSIG, signal.SIGKILL)


def adopt_orphans() -> None:
    """Become the parent of every descendant whose own parent ends, whatever session it has fled to."""
    _control_process(_PR_SET_CHILD_SUBREAPER, 1)


def children_of(pid: int) -> list[int]:
    """The children of a process, ended ones that nobody waited for included; none if the process is gone."""
    children: list[int] = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(OSError):
                children += map(int, (task / "children").read_bytes().split())
    return children


def family_of(pid: int) -> list[int]:
    """A process and all its descendants."""
    family = [pid]
    for member in family:
        family += children_of(member)
    return family


def kill(pids: list[int]) -> None:
    """Kill processes; those that are gone, or are none of ours, are left alone."""
    for pid in pids:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, signal.SIGKILL)


def end_family() -> None:
    """Kill all descendants of this process, which must have called `adopt_orphans`, and wait for their end."""
    own = os.getpid()
    with contextlib.suppress(ChildProcessError):
        while children := children_of(own):
            kill(children)
            os.waitpid(-1, 0)


def _control_process(option: int, value: int) -> None:
    if _PRCTL is not None:
        _PRCTL(option, value)
