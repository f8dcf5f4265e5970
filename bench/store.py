"""What is finished stays finished: datasets, predictions and scores on disk, each under the hash of what made it.

Everything is written to a temporary name and renamed, so that a run that is killed leaves nothing that looks
finished. Two runs may share a folder.
"""

import itertools
import json
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

_TEMPORARY = ".tmp"


class Store:
    """Folders under one root; the only state is on disk."""

    def __init__(self, root: Path) -> None:
        """Use a folder; it is made when something is first written."""
        self.root = root

    def dataset(self, key: str) -> Path:
        """Where the dataset of this key is, or will be."""
        return self.root / "datasets" / key

    def map_cache(self, key: str) -> Path:
        """Where the maps of the dataset of this key are, or will be, as arrays."""
        return self.root / "maps" / key

    def yardstick(self, key: str) -> Path:
        """Where the yardstick of this key is, or will be."""
        return self.root / "yardsticks" / f"{key}.bin"

    def prediction(self, key: str) -> Path:
        """Where the answer of this key is, or will be."""
        return self.root / "predictions" / key

    def read(self, kind: str, key: str) -> dict[str, Any] | None:
        """A finished document, or none."""
        try:
            document: dict[str, Any] = json.loads(self._document(kind, key).read_text(encoding="utf-8"))
        except (OSError, json.JSONDecodeError):
            return None
        return document

    def write(self, kind: str, key: str, document: dict[str, Any]) -> None:
        """Finish a document."""
        write_text(self._document(kind, key), json.dumps(document))

    @contextmanager
    def fill(self, folder: Path) -> Iterator[Path]:
        """A new folder that takes its place when the block ends well, and vanishes when it does not."""
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = _temporary_name(folder)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        try:
            yield partial
            shutil.rmtree(folder, ignore_errors=True)
            partial.rename(folder)
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def sweep_out(self) -> None:
        """Remove what killed processes of this machine left half-written, here and in the report beside it."""
        beside = (self.root.parent.glob(f"{place}*{_TEMPORARY}") for place in ("", "figures/"))
        for path in itertools.chain(self.root.glob(f"*/*{_TEMPORARY}"), *beside):
            host, _, pid = path.name.removesuffix(_TEMPORARY).rpartition(".")
            if host.endswith(f"@{socket.gethostname()}") and pid.isdigit() and not psutil.pid_exists(int(pid)):
                shutil.rmtree(path, ignore_errors=True)
                path.unlink(missing_ok=True)

    def _document(self, kind: str, key: str) -> Path:
        return self.root / kind / f"{key}.json"


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = _temporary_name(path)
    try:
        partial.write_bytes(data)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _temporary_name(path: Path) -> Path:
    return path.with_name(f"{path.name}@{socket.gethostname()}.{os.getpid()}{_TEMPORARY}")
