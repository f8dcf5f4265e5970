"""Files that are written whole or not at all."""

import errno
import os
from collections.abc import Mapping
from pathlib import Path


def write_whole(files: Mapping[Path, bytes]) -> None:
    """Write files that belong together under temporary names beside their places; when all are there, rename them.

    Raises:
        OSError: a folder cannot be written to, or a path is that of a folder.
    """
    temporary = {path: path.with_name(f".{path.name}.{os.getpid()}.tmp") for path in files}
    try:
        for path, data in files.items():
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, "is a folder, no file", str(path))
            temporary[path].write_bytes(data)
        for path in files:
            temporary[path].replace(path)
    finally:
        for path in temporary.values():
            path.unlink(missing_ok=True)
