"""Anybody's merger as a command: ``prog {maps} {out}`` reads a folder of maps and writes ``result.json``."""

import importlib
import os
import resource
import shlex
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from bench.mergers.environment import original_environment
from bench.mergers.fork_server import Failed, Skipped
from bench.mergers.lifeline import die_with_parent
from bench.one_line import one_line

PLACEHOLDERS = ("{maps}", "{out}")
"""What a command must contain."""
SCANS = "{scans}"
"""What a command may contain: a folder with the scans of each map, see `bench.mergers.submap_scans`."""
SKIP_STATUS = 77
"""Exit status of a command that cannot run here (as in Automake); its last line on stderr is the reason."""
LOG = "stderr.txt"
"""The end of what a command wrote to stderr, beside its answer."""
_ORDER = "order.txt"
_TAIL_BYTES = 4096
_CHUNK_BYTES = 1 << 16
_LAST_WORDS_S = 0.2
"""For which the end of stderr is awaited once a command has ended: something it started may hold it open."""


def check_command(command: str) -> None:
    """Refuse a command that could not be called.

    Raises:
        ValueError: it is empty, cannot be split into words, or lacks a placeholder.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise ValueError(f"method.command: {error}: {command!r}") from None
    missing = [name for name in PLACEHOLDERS if name not in command]
    if not words or missing:
        raise ValueError(f"method.command must contain {' and '.join(missing or PLACEHOLDERS)}, got {command!r}")


def call_command(command: str, maps: Sequence[Path], work: Path) -> dict[str, Any]:
    """Run an external method on copies of the maps, alone in a folder: the truth is nowhere near.

    ``{maps}`` holds the maps' YAML and image files; beside it lies ``order.txt``, their names in the order in which a
    sequential method is to take them.

    Args:
        command: The command, split as a shell would, with ``{maps}`` and ``{out}``.
        maps: YAML files of the maps, in order.
        work: A folder from `bench.mergers.workspace`, in which ``{out}`` is ``out``.

    Returns:
        Its time and peak memory.

    Raises:
        Skipped: it ended with status 77.
        Failed: it could not be started, or ended with another status than 0 (or 1, with a ``result.json``).
    """
    copies, out = work / "maps", work / "out"
    _copy_maps(maps, copies)
    places = {"{maps}": str(copies), "{out}": str(out), SCANS: str(_scans(command, maps, work))}
    words = [_fill_in(word, places) for word in shlex.split(command)]
    start, start_cpu_s = time.perf_counter(), _children_cpu_s()
    status, said = _run(words)
    fields = {"wall_s": time.perf_counter() - start, "cpu_s": _children_cpu_s() - start_cpu_s}
    _keep_log(out, said)
    last_line = one_line(said.splitlines()[-1], 300) if said else ""
    if status == SKIP_STATUS:
        raise Skipped(last_line or "the command says that it cannot run here")
    answered = status == 0 or (status == 1 and (out / "result.json").is_file())  # 1: nothing could be merged
    if not answered:
        raise Failed(f"the command ended with {_ending(status)}" + (f": {last_line}" if last_line else ""))
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
    return fields | {"peak_memory_mb": peak_mb}


def _children_cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _copy_maps(maps: Sequence[Path], folder: Path) -> None:
    folder.mkdir()
    for path in maps:
        shutil.copy(path, folder / path.name)
        shutil.copy(path.with_suffix(".pgm"), folder / path.with_suffix(".pgm").name)
    (folder.parent / _ORDER).write_text("".join(f"{path.stem}\n" for path in maps), encoding="utf-8")


def _scans(command: str, maps: Sequence[Path], folder: Path) -> Path:
    """The folder for the scans, filled if the command asks for them."""
    scans = folder / "scans"
    scans.mkdir()
    if SCANS in command:
        module = importlib.import_module("bench.mergers.submap_scans")  # large: a bare server does without
        module.write_submap_scans(maps[0].parent.parent, scans)
    return scans


def _fill_in(word: str, places: dict[str, str]) -> str:
    for placeholder, place in places.items():
        word = word.replace(placeholder, place)
    return word


def _run(words: list[str]) -> tuple[int, str]:
    """Run a command to its end: its exit status and the end of what it wrote to stderr."""
    try:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=original_environment() | {"PYTHONDONTWRITEBYTECODE": "1"},
            preexec_fn=die_with_parent,  # noqa: PLW1509  # the thread below does not run yet
        )
    except OSError as error:
        raise Failed(f"the command cannot be started: {error.strerror}: {words[0]}") from None
    tail = bytearray()
    reader = threading.Thread(target=_keep_tail, args=(process.stderr, tail), daemon=True)
    reader.start()
    status = process.wait()
    reader.join(_LAST_WORDS_S)
    return status, tail.decode("utf-8", errors="replace").strip()


def _keep_log(out: Path, said: str) -> None:
    """Leave what a command said beside its answer, where it has no such file of its own."""
    if said and out.is_dir() and not (out / LOG).exists():
        (out / LOG).write_text(f"{said}\n", encoding="utf-8")


def _keep_tail(stream: IO[bytes], tail: bytearray) -> None:
    """Read a stream to its end, and keep its last kilobytes: a program may write any amount."""
    while chunk := os.read(stream.fileno(), _CHUNK_BYTES):
        tail += chunk
        del tail[:-_TAIL_BYTES]


def _ending(status: int) -> str:
    if status >= 0:
        return f"exit status {status}"
    names = {number.value: number.name for number in signal.Signals}
    return f"exit status {status} ({names.get(-status, 'a signal')})"
