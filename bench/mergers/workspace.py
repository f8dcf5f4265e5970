"""Folders in which other people's commands work: far from any truth, and gone when the command is."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PREFIX = "mapmerge-"


@contextmanager
def make_workspace(out: Path) -> Iterator[Path]:
    """A folder for one command; what it leaves in ``out`` there is moved into ``out``.

    Args:
        out: An existing folder.

    Yields:
        A new folder with an empty folder ``out``; it is removed when the block ends, however the command ended.
    """
    prefix = f"{_PREFIX}{os.getpid()}-"
    with tempfile.TemporaryDirectory(prefix=prefix, ignore_cleanup_errors=True) as folder:
        answer = Path(folder) / "out"
        answer.mkdir()
        yield Path(folder)
        if answer.is_dir():
            for path in sorted(answer.iterdir()):
                _move(path, out / path.name)


def remove_workspaces(pid: int) -> None:
    """Remove what a process, which has ended, left of its workspaces."""
    for path in Path(tempfile.gettempdir()).glob(f"{_PREFIX}{pid}-*"):
        shutil.rmtree(path, ignore_errors=True)


def _move(path: Path, target: Path) -> None:
    """Move a file, a link or a folder; pipes and the like stay, also those within a folder."""
    if path.is_symlink() or path.is_file() or path.is_dir():
        with suppress(shutil.Error):
            shutil.move(path, target)
