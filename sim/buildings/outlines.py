"""The surfaces of a plan: the edges of its solids, without the parts that lie inside a wall."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from sim.buildings.plan import Material, Solid

Array = npt.NDArray[np.float64]

_SKIN_M = 1e-6
"""An edge counts as inside a wall only this far below the surface, so that flush pieces keep their faces."""
_SHORTEST_M = 1e-4
"""Shorter remains of an edge are dropped."""


def outline_segments(solids: Sequence[Solid]) -> tuple[Array, npt.NDArray[np.int8]]:
    """Edges of convex solids, cut where they run inside an opaque wall, which no ray from free space reaches.

    Args:
        solids: Convex pieces that may overlap.

    Returns:
        (N, 2, 2) segments in metres and the (N,) `Material` of each.
    """
    edges, owners = _edges_of(solids)
    walls = [k for k, solid in enumerate(solids) if solid.material == Material.WALL]
    hidden = _hidden_intervals(edges, owners, [solids[k].polygon for k in walls], np.array(walls, dtype=np.int64))
    pieces: list[Array] = []
    piece_owners: list[int] = []
    for k, (edge, owner) in enumerate(zip(edges, owners, strict=True)):
        kept = [edge] if k not in hidden else _remains(edge, hidden[k])
        pieces.extend(kept)
        piece_owners.extend([int(owner)] * len(kept))
    materials = np.array([solids[k].material for k in piece_owners], dtype=np.int8)
    return np.array(pieces, dtype=np.float64).reshape(-1, 2, 2), materials


def _edges_of(solids: Sequence[Solid]) -> tuple[Array, npt.NDArray[np.int64]]:
    """All (N, 2, 2) edges, and the (N,) index of the solid that each belongs to."""
    edges = [np.stack([s.polygon, np.roll(s.polygon, -1, axis=0)], axis=1) for s in solids]
    owners = np.repeat(np.arange(len(solids)), [len(s.polygon) for s in solids])
    return (np.concatenate(edges) if edges else np.zeros((0, 2, 2))), owners


def _hidden_intervals(
    edges: Array, owners: npt.NDArray[np.int64], walls: list[Array], wall_ids: npt.NDArray[np.int64]
) -> dict[int, list[tuple[float, float]]]:
    """By edge: the intervals of its parameter in [0, 1] that lie inside a wall which is not its own."""
    hidden: dict[int, list[tuple[float, float]]] = defaultdict(list)
    low, high = edges.min(axis=1, initial=np.inf), edges.max(axis=1, initial=-np.inf)
    for wall, wall_id in zip(walls, wall_ids, strict=True):
        near = np.all((low <= wall.max(axis=0)) & (high >= wall.min(axis=0)), axis=1) & (owners != wall_id)
        candidates = np.nonzero(near)[0]
        enter, leave = _inside(edges[candidates], wall)
        for k in np.nonzero(leave > enter)[0]:
            hidden[int(candidates[k])].append((float(enter[k]), float(leave[k])))
    return hidden


def _inside(edges: Array, polygon: Array) -> tuple[Array, Array]:
    """Cyrus-Beck clipping: (N,) parameters at which each edge enters and leaves a convex polygon."""
    along = np.roll(polygon, -1, axis=0) - polygon
    inward = np.stack([-along[:, 1], along[:, 0]], axis=-1) / np.hypot(along[:, 0], along[:, 1])[:, None]
    depth = np.einsum("pk,npk->np", inward, edges[:, None, 0] - polygon[None]) - _SKIN_M
    slope = (edges[:, 1] - edges[:, 0]) @ inward.T
    parallel = np.abs(slope) < 1e-12
    crossing = -depth / np.where(parallel, 1.0, slope)
    enter = np.where(parallel, np.where(depth > 0.0, -np.inf, np.inf), np.where(slope > 0.0, crossing, -np.inf))
    leave = np.where(~parallel & (slope < 0.0), crossing, np.inf)
    return np.maximum(enter.max(axis=1), 0.0), np.minimum(leave.min(axis=1), 1.0)


def _remains(edge: Array, hidden: list[tuple[float, float]]) -> list[Array]:
    """The visible pieces, (2, 2) each, of an edge of which these parts are hidden."""
    length_m = float(np.hypot(*(edge[1] - edge[0])))
    pieces, position = [], 0.0
    for enter, leave in [*sorted(hidden), (1.0, 1.0)]:
        if (enter - position) * length_m > _SHORTEST_M:
            pieces.append(edge[0] + np.array([[position], [enter]]) * (edge[1] - edge[0]))
        position = max(position, leave)
    return pieces
