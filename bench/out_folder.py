"""The folder of results: taken only if it is empty or already ours, and can be written."""

import tempfile
from pathlib import Path

STORE = "store"
"""Where finished cells lie, below the folder of results."""
_OURS = (STORE, "scores.parquet")
"""A folder that holds one of these has held results before."""


def claim_folder(out: Path) -> None:
    """Make a folder ready for results, before anything runs.

    Args:
        out: A new folder, an empty one, or one with results of the bench, which are continued.

    Raises:
        ValueError: it is not a folder, holds something else, which would be lost, or cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise ValueError(f"out: {out} is not a folder")
    try:
        if out.is_dir() and any(out.iterdir()) and not any((out / name).exists() for name in _OURS):
            raise ValueError(f"out: {out} holds something else than results of the bench, and is not overwritten")
        (out / STORE).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out / STORE):
            pass
    except OSError as error:
        raise ValueError(f"out: {out} cannot be written ({error.strerror})") from None
