"""What every answer to one dataset is measured against, worked out once however many methods answer."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.scoring import grid_metrics, objective
from merger import se2
from merger.edges import extract_edge_points
from sim.datasets.dataset import Dataset
from sim.maps.truth import Truth

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Yardstick:
    """The truth of N maps, and what follows from it alone."""

    truth: Truth
    """Names, true poses and overlaps."""
    edges_map: tuple[Array, ...]
    """N arrays (n, 2) of edge points, metres in each map's own frame."""
    resolutions_m: tuple[float, ...]
    """Side of each map's cells."""
    grid: grid_metrics.TrueGrid
    """The maps laid out by the truth."""
    objective_floor: float
    """`objective.score_objective` of the true motions of all maps, cells^2."""

    def objective(self, T_ref_map: Array, component: npt.NDArray[np.int64]) -> float:
        """`objective.score_objective` of (N, 3, 3) motions in (N,) components."""
        return objective.score_objective(self.edges_map, self.resolutions_m, T_ref_map, component)


def make_yardstick(dataset: Dataset) -> Yardstick:
    """Work out what the truth of a dataset decides."""
    truth = dataset.truth
    edges = tuple(se2.transform_points(m.T_map_grid, extract_edge_points(m)) for m in dataset.maps)
    cells = tuple(m.resolution_m for m in dataset.maps)
    together = np.zeros(len(edges), dtype=np.int64)
    floor = objective.score_objective(edges, cells, truth.T_world_map, together)
    return Yardstick(truth, edges, cells, grid_metrics.lay_true_grid(dataset.maps, truth.T_world_map), floor)
