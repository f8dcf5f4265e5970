"""The version that datasets carry."""

import importlib.metadata
import tomllib
from pathlib import Path

_DISTRIBUTION = "mapmerge-bench"


def package_version() -> str:
    """Version of the installed distribution, or of the checkout when nothing is installed."""
    try:
        return importlib.metadata.version(_DISTRIBUTION)
    except importlib.metadata.PackageNotFoundError:
        project = Path(__file__).resolve().parent.parent / "pyproject.toml"
        return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"])
