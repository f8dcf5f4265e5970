"""Where the files that travel with the code lie: ``worlds/`` and ``conf/``, in a checkout and in a wheel."""

from pathlib import Path


def worlds_folder() -> Path:
    """The folder of the world files."""
    return _folder("worlds")


def conf_folder() -> Path:
    """The folder of the hydra configuration."""
    return _folder("conf")


def _folder(name: str) -> Path:
    package = Path(__file__).resolve().parent
    inside_wheel = package / name
    return inside_wheel if inside_wheel.is_dir() else package.parent / name
