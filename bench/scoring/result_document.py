"""A ``result.json`` from disk to plain values; what a program may have put in its place is refused with a reason."""

import json
import reprlib
import stat
from collections import Counter
from pathlib import Path
from typing import Any

from bench.one_line import one_line

MAX_BYTES = 64 << 20
"""A larger file is not read; with 40 maps it has less than a megabyte."""


class PredictionError(ValueError):
    """A ``result.json`` cannot be scored; the message is one line that says why."""


def read_document(path: Path) -> dict[str, Any]:
    """Read the object that a file holds.

    Raises:
        PredictionError: the file is missing, no JSON of schema 1, too large, too deep, or names a key twice.
    """
    try:
        document = json.loads(_read_text(path), object_pairs_hook=_unique_keys)
    except json.JSONDecodeError as error:
        raise PredictionError(f"result.json is not JSON (line {error.lineno}: {error.msg})") from None
    except RecursionError:
        raise PredictionError("result.json is nested too deeply") from None
    except PredictionError:
        raise
    except ValueError as error:  # a number of thousands of digits
        raise PredictionError(f"result.json cannot be read ({one_line(str(error), 80)})") from None
    if not isinstance(document, dict):
        raise PredictionError("result.json is not an object")
    if document.get("schema") != 1 or document["schema"] is True:
        raise PredictionError(f"result.json: schema must be 1, got {show(document.get('schema'))}")
    return document


def _read_text(path: Path) -> str:
    """The text of a regular file of sane size: a pipe or a device would never end."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise PredictionError("result.json is no regular file")
        if status.st_size > MAX_BYTES:
            raise PredictionError(f"result.json is too large: {status.st_size >> 20} MiB, at most {MAX_BYTES >> 20}")
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise PredictionError("no result.json was written") from None
    except (OSError, UnicodeDecodeError) as error:
        raise PredictionError(f"result.json cannot be read ({type(error).__name__})") from None


def _unique_keys(items: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of the file; one that says something twice says nothing."""
    document = dict(items)
    if len(document) < len(items):
        twice = next(key for key, count in Counter(key for key, _ in items).items() if count > 1)
        raise PredictionError(f"result.json has the key '{one_line(twice, 80)}' twice in one object")
    return document


def show(value: object) -> str:
    """A value for a message, however large it is."""
    return one_line(reprlib.repr(value), 120)
