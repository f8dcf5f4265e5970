"""A dataset folder appears whole or not at all: it is built beside its place, and gets its name when it is finished."""

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil

INDEX = "dataset.json"
"""The file that makes a folder a dataset; written last."""


class DatasetError(ValueError):
    """A dataset cannot be read or written; the message is one line that names the folder and the fault."""


def refuse_to_overwrite(out: Path) -> None:
    """Refuse a place that holds something else than an older dataset.

    Raises:
        DatasetError: ``out`` is a file, or a folder with files but without an index, or cannot be created.
    """
    if out.is_dir():
        if any(out.iterdir()) and not (out / INDEX).is_file():
            raise DatasetError(f"{out}: the folder holds something else than a dataset, and is not overwritten")
    elif out.exists() or out.is_symlink():
        raise DatasetError(f"{out}: is not a folder, and is not overwritten")
    parent = next(folder for folder in out.absolute().parents if folder.exists())
    try:
        with TemporaryDirectory(prefix=f".{out.name}.{os.getpid()}.", suffix=".partial", dir=parent):
            pass
    except OSError:
        raise DatasetError(f"{out}: cannot be written (in {parent})") from None


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """A folder to fill, that becomes ``out`` (replacing an older dataset) if the block ends well, else disappears.

    Raises:
        DatasetError: ``out`` is something else than an older dataset, or cannot be written.
    """
    refuse_to_overwrite(out)
    out = out.absolute()
    partial = out.with_name(f".{out.name}.{os.getpid()}.partial")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(out)
        partial.mkdir()
    except OSError as error:
        raise DatasetError(f"{out}: cannot be written ({error.strerror})") from None
    try:
        yield partial
        _give_name(partial, out)
    finally:
        _discard(partial)


def remove_leftovers(out: Path) -> None:
    """Remove what processes that were killed while they made ``out`` left beside it."""
    for left in out.absolute().parent.glob(f".{out.name}.*.partial"):
        owner = left.name.removeprefix(f".{out.name}.").split(".")[0]
        if owner.isdigit() and (int(owner) == os.getpid() or not psutil.pid_exists(int(owner))):
            _discard(left)


def write_index(folder: Path, fields: dict[str, Any]) -> None:
    """Write ``dataset.json``: the fields, and the checksum of every file in the folder."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    files = {path.relative_to(folder).as_posix(): file_sha256(path) for path in paths}
    temporary = folder / f".{INDEX}.tmp"
    temporary.write_bytes(encode_index({"schema": 1, **fields, "files": files}))
    temporary.replace(folder / INDEX)


def encode_index(document: dict[str, Any]) -> bytes:
    """The bytes of ``dataset.json``."""
    return (json.dumps(document, indent=1, allow_nan=False) + "\n").encode()


def read_index(folder: Path) -> dict[str, Any]:
    """Read ``dataset.json``.

    Raises:
        DatasetError: the folder is not a dataset, or the index lacks a field.
    """
    try:
        document: Any = json.loads((folder / INDEX).read_text(encoding="utf-8"))
    except OSError:
        raise DatasetError(f"{folder}: not a dataset (no {INDEX})") from None
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise DatasetError(f"{folder / INDEX}: not JSON") from None
    kinds = {"schema": int, "name": str, "seed": int, "version": str, "config": dict, "files": dict}
    for key, kind in kinds.items():
        if not isinstance(document, dict) or not isinstance(document.get(key), kind):
            raise DatasetError(f"{folder / INDEX}: field '{key}' is missing or not of type {kind.__name__}")
    if document["schema"] != 1:
        raise DatasetError(f"{folder / INDEX}: schema must be 1, got {document['schema']}")
    return dict(document)


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _give_name(partial: Path, out: Path) -> None:
    """Give a finished folder its name; an older dataset steps aside first."""
    if out.is_dir() and any(out.iterdir()):
        old = out.with_name(f".{out.name}.{os.getpid()}.old.partial")
        out.rename(old)
        partial.rename(out)
        _discard(old)
    else:
        partial.rename(out)


def _discard(folder: Path) -> None:
    """Remove a folder, its index first: what is left when this is interrupted does not pass for a dataset."""
    (folder / INDEX).unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
