"""The faces of a map's walls: where occupied cells touch free space, the only part of a wall that is known well.

Where a face lies is settled by many beams that end there or pass, and that agree on average. How far a wall reaches
behind its face is settled by the few beams that ended farthest behind: by noise, in each map anew. Backs that meet
backs thus say nothing, and neither do holes within thick walls; laid onto one another, they hold maps where they are.
"""

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from merger.robust.wall_kernels import FREE, OCCUPIED, Fields, Walls
from merger.robust.wall_structure import WallStructure

Cells = npt.NDArray[np.intp]


def extract_faces(structure: WallStructure) -> WallStructure:
    """Keep of a map's walls what touches free space (see `merger.edges`).

    Args:
        structure: All walls of a map.

    Returns:
        The map with fewer wall points, and fields that answer for these; all of them where none touches free space.
    """
    state = structure.fields.state
    near_free = cv2.dilate((state == FREE).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    faces = (state == OCCUPIED) & near_free
    rows, cols = np.nonzero(faces)
    if len(rows) == 0:
        return structure
    point = structure.fields.nearest[rows, cols]
    kept = np.bincount(point, minlength=len(structure.walls.points)) > 0
    number = (np.cumsum(kept) - 1)[point]
    walls = _place(structure, kept, number, (rows, cols))
    return replace(structure, walls=walls, fields=_answer(structure.fields, faces, number, (rows, cols)))


def _place(structure: WallStructure, kept: npt.NDArray[np.bool_], number: Cells, cells: tuple[Cells, Cells]) -> Walls:
    """The wall points that are kept, each in the middle of its cells that are faces."""
    walls = Walls(structure.walls.table[kept])
    rows, cols = cells
    for axis, places in enumerate((cols, rows)):
        walls.points[:, axis] = np.bincount(number, places + 0.5) / np.bincount(number) * structure.fields.resolution_m
    return walls


def _answer(fields: Fields, faces: npt.NDArray[np.bool_], number: Cells, cells: tuple[Cells, Cells]) -> Fields:
    """Fields that know the faces alone."""
    elsewhere = (~faces).astype(np.uint8)
    distance, labels = cv2.distanceTransformWithLabels(elsewhere, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    number_of_label = np.zeros(int(labels.max()) + 1, dtype=np.int32)
    number_of_label[labels[cells]] = number
    distance_m = np.asarray(distance, np.float32) * np.float32(fields.resolution_m)
    distance_m[np.isinf(fields.distance_m)] = np.inf  # The outermost cells answer for all places outside.
    return fields._replace(distance_m=distance_m, nearest=number_of_label.take(np.asarray(labels, np.int32)))
