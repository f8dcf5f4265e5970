"""What a merge needs of each map: keypoints and edge points, computed once."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.edges import extract_edge_points
from merger.features import FeatureConfig, Features, extract_features
from merger.grid_map import GridMap
from merger.nearest_edges import EdgeIndex, index_edges


@dataclass(frozen=True)
class PreparedMap:
    """Evidence of one map. Its numbers do not depend on where the map's origin lies."""

    name: str
    """The map's name."""
    T_map_grid: npt.NDArray[np.float64]
    """(3, 3) pose of the grid's corner in the map's own metres."""
    features: Features
    """SIFT keypoints."""
    edges: EdgeIndex | None
    """Edge points; None if the map has fewer than two."""

    @property
    def T_map_center(self) -> npt.NDArray[np.float64]:
        """(3, 3) pose of the middle of the edge points in the map's own metres, with the grid's orientation."""
        center = np.zeros(2) if self.edges is None else self.edges.points_grid.mean(axis=0)
        return np.asarray(self.T_map_grid @ se2.make_motion(center[0], center[1], 0.0))


def prepare_map(grid: GridMap, config: FeatureConfig) -> PreparedMap:
    """Extract the SIFT keypoints and the edge points of one map (first line of Algorithm 4)."""
    points_grid = extract_edge_points(grid)
    edges = index_edges(points_grid, grid.resolution_m) if len(points_grid) >= 2 else None
    return PreparedMap(grid.name, grid.T_map_grid, extract_features(grid, config), edges)
