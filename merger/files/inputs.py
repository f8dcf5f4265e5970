"""The maps that a command line names: YAML files, folders, datasets, recordings."""

import os
from collections.abc import Sequence
from pathlib import Path

from merger.grid_map import GridMap
from merger.map_server import MapFileError, read_map

_YAML_SUFFIXES = (".yaml", ".yml")


def read_maps(paths: Sequence[str | os.PathLike[str]]) -> list[GridMap]:
    """Read all maps that the paths name, in their order; those of a folder in the order of names, without hidden
    files.

    Args:
        paths: `map_server` YAML files; folders that hold them; dataset folders (with ``dataset.json``: their
            ``maps``); or MCAP files with OccupancyGrid messages.

    Raises:
        MapFileError: a file is missing or cannot be used, a folder holds no map, or two maps have one name.
    """
    maps: dict[str, GridMap] = {}
    sources: dict[str, Path] = {}
    for path in map(Path, paths):
        for grid, source in _read(path):
            if grid.name in maps:
                raise MapFileError(f"{source}: the name '{grid.name}' is already that of {sources[grid.name]}")
            maps[grid.name], sources[grid.name] = grid, source
    return list(maps.values())


def _read(path: Path) -> list[tuple[GridMap, Path]]:
    if path.suffix.lower() == ".mcap":
        # Loaded only when needed: it takes longer than reading most maps.
        from merger.files.mcap_reader import read_recording  # noqa: PLC0415 # see above

        return [(grid, path) for grid in read_recording(path)]
    files = _list_yamls(path) if path.is_dir() else [path]
    return [(read_map(file), file) for file in files]


def _list_yamls(folder: Path) -> list[Path]:
    if (folder / "dataset.json").is_file():
        folder = folder / "maps"
    files = sorted(file for file in folder.glob("[!.]*") if file.suffix.lower() in _YAML_SUFFIXES and file.is_file())
    if not files:
        raise MapFileError(f"{folder}: the folder holds no map (no YAML file)")
    return files
