"""Which code made a result: hashes of source files, so that cached cells never outlive the code that made them."""

import functools
import hashlib
import importlib.metadata
import platform
import shlex
import shutil
import subprocess
from pathlib import Path

import bench
import merger
import sim
from sim.version import package_version

_LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "numba")
_MERGER_NOUNS = ("se2.py", "grid_map.py", "map_server.py")


@functools.cache
def merger_version() -> str:
    """Hash of the merger's sources and of the libraries that its answers depend on."""
    return _hash_files(_sources(merger.__file__, "*.py"), _library_versions())


@functools.cache
def dataset_version() -> str:
    """Hash of all that makes a dataset: the simulator, its worlds and configuration, and the merger's nouns."""
    nouns = [path for path in _sources(merger.__file__, "*.py") if path.name in _MERGER_NOUNS]
    return _hash_files(_sources(sim.__file__, "*.py") + nouns, _library_versions())


@functools.cache
def score_version() -> str:
    """Hash of the sources that define the scores."""
    return _hash_files(_sources(bench.__file__, "scoring/*.py"), merger_version())


def command_version(command: str) -> str:
    """Hash of a command and of the files that it names, so that an edited program is run again."""
    words = shlex.split(command)
    paths = [Path(found) for word in words if (found := shutil.which(word) or word) and Path(found).is_file()]
    return _hash_files(sorted(paths), command)


@functools.cache
def file_version(path: Path) -> str:
    """Hash of one file's content; of its name where there is none."""
    return _hash_files([path] if path.is_file() else [], path.name)


def provenance() -> dict[str, str]:
    """Versions, revision and machine, for the report."""
    lines = {
        "mapmerge-bench": package_version(),
        "revision": _git_revision(),
        "merger sources": merger_version(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
    }
    return lines | {name: _distribution_version(name) for name in _LIBRARIES}


def _sources(package_file: str | None, pattern: str) -> list[Path]:
    return sorted(Path(str(package_file)).parent.rglob(pattern))


def _hash_files(paths: list[Path], salt: str) -> str:
    digest = hashlib.sha256(salt.encode())
    for path in paths:
        facts = path.stat()
        digest.update(path.name.encode() + b"\0" + _hash_file(path, facts.st_mtime_ns, facts.st_size))
    return digest.hexdigest()[:20]


@functools.lru_cache(maxsize=4096)
def _hash_file(path: Path, _mtime_ns: int, _size: int) -> bytes:
    """Hash of a file's content, computed again when the file was written to."""
    return hashlib.sha256(path.read_bytes()).digest()


def _library_versions() -> str:
    return " ".join(f"{name}={_distribution_version(name)}" for name in _LIBRARIES)


def _distribution_version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _git_revision() -> str:
    command = ["git", "-C", str(Path(bench.__file__).parent), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")
