"""The files of a merge: ``result.json``, the merged map, its picture, and the graph."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

import cv2

from merger.files.g2o import encode_g2o
from merger.files.merged_picture import draw_merge
from merger.files.result_json import to_json_dict
from merger.grid_map import GridMap
from merger.map_server import encode_map
from merger.result import MergeResult
from merger.whole_file import write_whole


def write_result(folder: str | os.PathLike[str], result: MergeResult, maps: Sequence[GridMap]) -> None:
    """Write a merge into a folder, which is made if need be: all files or none; ``result.json`` comes last.

    Args:
        folder: Where to write.
        result: The merge.
        maps: The maps that were merged, in any order; the picture shows them.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder = Path(folder)
    files = {folder / "graph.g2o": encode_g2o(result)}
    if result.merged is not None:
        files.update(encode_map(folder / "merged.yaml", result.merged))
        picture = draw_merge(result.merged, sorted(maps, key=lambda grid: grid.name), result.maps, result.reference)
        files[folder / "merged.png"] = cv2.imencode(".png", picture)[1].tobytes()
    files[folder / "result.json"] = (json.dumps(to_json_dict(result), indent=1, allow_nan=False) + "\n").encode()
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(files)
