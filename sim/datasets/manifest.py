"""What a published dataset must be: its truth, its maps in figures, and the checksum of every file.

Another processor's mathematics library may differ in the last bit, and a simulation makes more of it; so a dataset
that is made again is the same if its truth and maps agree within tolerances, and, where the platform is the same, every
checksum.
"""

import json
import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding  # type: ignore[import-untyped] # it has no stubs
import numpy as np

from merger import se2
from sim.datasets.dataset import Dataset, read_dataset
from sim.datasets.dataset_folder import INDEX, file_sha256, read_index
from sim.maps.truth import Truth, from_json_dict, to_json_dict

POSITION_TOLERANCE_M = 0.05
"""A submap's true place may differ by this."""
ANGLE_TOLERANCE_RAD = 0.005
"""A submap's true angle may differ by this."""
CELLS_TOLERANCE = 0.03
"""The numbers of a map's occupied and of its free cells may differ by this share."""
OVERLAP_TOLERANCE = 0.05
"""An overlap fraction may differ by this."""
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "pymunk", "mcap", "zstandard")


def make_manifest(folder: Path) -> dict[str, Any]:
    """Describe a dataset.

    Raises:
        ValueError: the folder is not a dataset, or one of its files cannot be used.
    """
    dataset, index = read_dataset(folder), read_index(folder)
    return {
        "schema": 1,
        "name": dataset.name,
        "version": index["version"],
        "platform": describe_platform(),
        "config": index["config"],
        "files": {**index["files"], INDEX: file_sha256(folder / INDEX)},
        "maps": _map_figures(dataset),
        "truth": to_json_dict(dataset.truth),
    }


def read_manifest(path: Path) -> dict[str, Any]:
    """Read a manifest that `make_manifest` made.

    Raises:
        ValueError: the file cannot be read or is no manifest; the message is one line that names it.
    """
    try:
        document: Any = json.loads(path.read_text(encoding="utf-8"))
        kinds = {"schema": int, "version": str, "platform": dict, "config": dict, "files": dict, "truth": dict}
        sound = all(isinstance(document[key], kind) for key, kind in kinds.items())
        counts = [found[kind] for found in document["maps"].values() for kind in ("occupied", "free")]
        sound = sound and all(isinstance(count, int) for count in counts)
        sound = sound and document["maps"].keys() == document["truth"]["maps"].keys()
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except (KeyError, TypeError, AttributeError, ValueError):
        sound = False
    if not sound or document["schema"] != 1:
        raise ValueError(f"{path}: not a manifest of schema 1")
    return dict(document)


def compare_manifest(folder: Path, manifest: dict[str, Any]) -> list[str]:
    """What of a dataset is not as its manifest says, one line each.

    Config, names and robots must agree; places, maps and overlaps within this module's tolerances; on the platform
    that the manifest was made on, every checksum, too.

    Raises:
        ValueError: the folder is not a dataset, or one of its files cannot be used.
    """
    dataset, index = read_dataset(folder), read_index(folder)
    expected = from_json_dict(manifest["truth"])
    if index["config"] != manifest["config"]:
        return ["the configuration differs"]
    if (dataset.truth.names, dataset.truth.robot) != (expected.names, expected.robot):
        return ["the maps or their robots differ"]
    faults = [*_compare_places(dataset.truth, expected), *_compare_maps(dataset, manifest["maps"])]
    if manifest["platform"] == describe_platform() and manifest["version"] == index["version"]:
        differing = [name for name, checksum in index["files"].items() if manifest["files"].get(name) != checksum]
        faults += [f"{name}: its checksum differs, on the same platform" for name in differing]
    return faults


def describe_platform() -> dict[str, str]:
    """All that may change the last bit of a number."""
    return {
        "machine": platform.machine(),
        "cpu": str(llvmlite.binding.get_host_cpu_name()),
        "libc": " ".join(platform.libc_ver()),
        "python": platform.python_version(),
        **{library: version(library) for library in _LIBRARIES},
    }


def _compare_places(truth: Truth, expected: Truth) -> Iterator[str]:
    """Places and overlaps against those of the manifest."""
    moved = se2.parameters_of(se2.invert(expected.T_world_map) @ truth.T_world_map)
    for name, (x, y, theta) in zip(expected.names, moved, strict=True):
        if np.hypot(x, y) > POSITION_TOLERANCE_M or abs(theta) > ANGLE_TOLERANCE_RAD:
            yield f"{name}: its true place differs by {np.hypot(x, y):.3f} m, {abs(theta):.4f} rad"
    if np.abs(truth.overlap - expected.overlap).max() > OVERLAP_TOLERANCE:
        yield f"the overlaps differ by up to {np.abs(truth.overlap - expected.overlap).max():.3f}"


def _compare_maps(dataset: Dataset, expected: dict[str, dict[str, int]]) -> Iterator[str]:
    """Numbers of cells against those of the manifest."""
    for name, figures in _map_figures(dataset).items():
        for kind, count in figures.items():
            if abs(count - expected[name][kind]) > CELLS_TOLERANCE * expected[name][kind]:
                yield f"{name}: {count} {kind} cells, {expected[name][kind]} expected"


def _map_figures(dataset: Dataset) -> dict[str, dict[str, int]]:
    """Occupied and free cells of each map."""
    return {grid.name: {"occupied": int(grid.occupied.sum()), "free": int(grid.free.sum())} for grid in dataset.maps}
