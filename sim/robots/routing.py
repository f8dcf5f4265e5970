"""Ways through a building for a disc: shortest paths that keep away from walls where there is room."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.spatial import cKDTree

from sim.buildings.free_space import FreeSpace
from sim.buildings.grid_paths import grid_graph, search, trace_path

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_COMFORT_M = 0.35
"""With so much more clearance than it needs a disc goes straight."""
_DETOUR = 3.0
"""Cost of a metre along a wall, beside one in the open, minus one."""
_SMOOTHING_CELLS = 4
"""Half the window of the moving average that rounds a path's corners."""


class Router:
    """The free floor of a building for discs of one radius, ready to be searched."""

    def __init__(self, space: FreeSpace, passable: Mask, radius_m: float) -> None:
        """Build the graph.

        Args:
            space: Clearances.
            passable: (H, W) cells that a disc's centre may enter.
            radius_m: Radius of the disc with its safety margin.
        """
        self.space, self.passable = space, passable
        spare = np.clip((space.clearance_m - radius_m) / _COMFORT_M, 0.0, 1.0)
        self.cost = space.resolution_m * (1.0 + _DETOUR * (1.0 - spare) ** 2)
        self.graph = grid_graph(passable, self.cost)

    @property
    def floor_m2(self) -> float:
        """Area of the floor that a disc's centre may enter."""
        return float(np.count_nonzero(self.passable)) * self.space.resolution_m**2

    def clearance_at(self, x_m: float, y_m: float) -> float:
        """Distance in metres to the nearest surface."""
        space = self.space
        row = int((y_m - space.origin_m[1]) / space.resolution_m)
        col = int((x_m - space.origin_m[0]) / space.resolution_m)
        return float(space.clearance_m[row, col])

    def node_at(self, point: Array) -> int:
        """The passable cell nearest to a (2,) point."""
        row, col = self.space.cells_of(point)
        cols = self.passable.shape[1]
        if self.passable[row, col]:
            return int(row * cols + col)
        nodes = np.nonzero(self.passable.ravel())[0]
        away = np.hypot(nodes // cols - row, nodes % cols - col)
        return int(nodes[np.argmin(away)])

    def point_of(self, nodes: npt.NDArray[np.int64]) -> Array:
        """(..., 2) centres in metres of (...) nodes."""
        cols = self.passable.shape[1]
        return self.space.centers_of(np.stack([nodes // cols, nodes % cols], axis=-1))

    def route(self, start: int, goal: int, limit_m: float = np.inf, avoid: Sequence[tuple[Array, float]] = ()) -> Array:
        """A smooth path between two nodes.

        Args:
            start: Node to start from.
            goal: Node to reach.
            limit_m: An upper bound of the path's cost, which makes the search short.
            avoid: Discs, (2,) centre and radius, whose cells may not be entered.

        Returns:
            (M, 2) points about a cell apart in metres; (0, 2) if there is no way.
        """
        graph = self.graph if not avoid else self._graph_without(avoid, start)
        distance, before = search(graph, start, limit_m)
        if not np.isfinite(distance[goal]):
            return np.zeros((0, 2))
        return self._smooth(self.point_of(trace_path(before, goal)))

    def wander(self, start: int, limit_m: float, rng: np.random.Generator) -> Array:
        """A (M, 2) path to any place whose way costs at most this."""
        distance, before = search(self.graph, start, limit_m)
        goal = int(rng.choice(np.nonzero(np.isfinite(distance))[0]))
        return self._smooth(self.point_of(trace_path(before, goal)))

    def nearest_refuge(self, start: int, way: Array, distance_m: float, avoid: Sequence[tuple[Array, float]]) -> Array:
        """The shortest path out of somebody's way.

        Args:
            start: Node to start from.
            way: (M, 2) points that somebody will pass, metres.
            distance_m: How far from them a place must be.
            avoid: Discs, (2,) centre and radius, that may not be crossed.

        Returns:
            (M, 2) points; (0, 2) if there is no refuge.
        """
        distance, before = search(self._graph_without(avoid, start), start)
        nodes = np.nonzero(np.isfinite(distance))[0]
        away = np.asarray(cKDTree(way).query(self.point_of(nodes))[0]) > distance_m
        if not away.any():
            return np.zeros((0, 2))
        refuge = nodes[away][np.argmin(distance[nodes[away]])]
        return self._smooth(self.point_of(trace_path(before, int(refuge))))

    def _graph_without(self, avoid: Sequence[tuple[Array, float]], start: int) -> sparse.csr_array:
        """The graph without the cells of some discs, which shrink so far that the start is well outside them."""
        passable = self.passable.copy()
        nodes = np.nonzero(passable.ravel())[0]
        points = self.point_of(nodes)
        here = self.point_of(np.array(start))
        for center, radius_m in avoid:
            room_m = float(np.hypot(*(here - center))) - 1.5 * self.space.resolution_m
            passable.ravel()[nodes[np.hypot(*(points - center).T) < min(radius_m, room_m)]] = False
        return grid_graph(passable, self.cost)

    def _smooth(self, path: Array) -> Array:
        """Round the corners of a path wherever the mean of its neighbours has the clearance that a disc needs."""
        if len(path) < 3:
            return path
        half = min(_SMOOTHING_CELLS, (len(path) - 1) // 2)
        padded = np.concatenate([np.repeat(path[:1], half, axis=0), path, np.repeat(path[-1:], half, axis=0)])
        sums = np.cumsum(np.concatenate([np.zeros((1, 2)), padded]), axis=0)
        mean = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
        rows, cols = self.space.cells_of(mean).T
        mean[[0, -1]] = path[[0, -1]]
        return np.where(self.passable[rows, cols][:, None], mean, path)
