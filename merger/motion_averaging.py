"""Fine global motions from all reliable relative motions: the paper's Algorithm 3 (Eqs. 12-19)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.motion_graph import MotionGraph


@dataclass(frozen=True)
class MotionAveragingConfig:
    """Settings of the refinement.

    Raises:
        ValueError: a setting is out of its range.
    """

    max_iterations: int = 100
    """Rounds at most, >= 0; 0 leaves the coarse motions as they are."""
    tolerance: float = 1e-10
    """The refinement ends when no increment is larger (metres and radians), > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.max_iterations < 0:
            raise ValueError(f"averaging.max_iterations must be >= 0, got {self.max_iterations}")
        if not self.tolerance > 0.0:
            raise ValueError(f"averaging.tolerance must be > 0, got {self.tolerance}")


@dataclass(frozen=True)
class AveragingResult:
    """The refined motions."""

    T_root_map: npt.NDArray[np.float64]
    """(N, 3, 3) fine global motions; that of map 0 is unchanged."""
    iterations: int
    """Rounds that were made."""
    converged: bool
    """Whether the increments fell below the tolerance."""


def average_motions(
    graph: MotionGraph, T_root_map: npt.NDArray[np.float64], config: MotionAveragingConfig
) -> AveragingResult:
    """Refine global motions until they explain all relative motions as well as they can.

    Each round linearises (Eqs. 14-16), solves by the pseudo-inverse of D (Eq. 18), and updates from the left
    (Eq. 19). D is constant and has the identity of order 3 in each block, so it is inverted once, with one number
    a block. The converged answer does not depend on which map is the root.

    Note: The sign of Eq. 14 contradicts Eqs. 15 and 16; these two, with the left update of Eq. 19, are used.

    Args:
        graph: Reliable relative motions that connect all maps.
        T_root_map: (N, 3, 3) coarse global motions.
        config: Settings.

    Returns:
        The fine global motions.
    """
    if graph.num_maps < 2:
        return AveragingResult(T_root_map, 0, True)
    i, j = graph.edges.T
    D = _make_indicator(graph)
    D_pinv = np.linalg.solve(D.T @ D, D.T)  # D has full column rank where the graph is connected.
    for iteration in range(config.max_iterations):
        dT_i_j = T_root_map[i] @ graph.T_i_j @ se2.invert(T_root_map[j])  # Eq. (15).
        increments = D_pinv @ se2.log(dT_i_j)  # Eqs. (12), (17), (18).
        T_root_map = np.concatenate([T_root_map[:1], se2.exp(increments) @ T_root_map[1:]])  # Eq. (19).
        if np.abs(increments).max() < config.tolerance:
            return AveragingResult(T_root_map, iteration + 1, True)
    return AveragingResult(T_root_map, config.max_iterations, False)


def _make_indicator(graph: MotionGraph) -> npt.NDArray[np.float64]:
    """(E, N - 1) matrix D of Eq. 16, one number for each block of order 3: 1 at j, -1 at i, no column for map 0."""
    D = np.zeros((len(graph.edges), graph.num_maps))
    row = np.arange(len(graph.edges))
    D[row, graph.edges[:, 1]] = 1.0
    D[row, graph.edges[:, 0]] = -1.0
    return D[:, 1:]
