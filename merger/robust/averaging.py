"""Motion averaging with each relative motion's information and a robust kernel (the paper's Algorithm 3, weighted).

A corridor pins a motion across, not along: each relative motion counts by its information matrix. Its weight falls
with its residual (Geman-McClure), from a wide kernel to one that fits the residuals' own scale (graduated
non-convexity [Yang 2020]). Sparse, for thousands of maps.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.motion_graph import MotionGraph

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.intp]

_DENSE_MAPS = 100
"""So many maps at most are solved for by a dense matrix."""
_DAMPING = 1e-9
"""Of the mean diagonal of the normal matrix, added to it."""


@dataclass(frozen=True)
class RobustAveragingConfig:
    """Settings of the averaging.

    Raises:
        ValueError: a setting is out of its range.
    """

    max_iterations: int = 50
    """Gauss-Newton steps, at least 1."""
    tolerance: float = 1e-9
    """The steps end when none is longer, metres and radians, > 0."""
    annealing: float = 1.6
    """The kernel's width falls by this factor a step, > 1."""
    min_scale: float = 2.0
    """The kernel is never narrower, in standard deviations, > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.max_iterations < 1:
            raise ValueError(f"max_iterations must be >= 1, got {self.max_iterations}")
        if not self.annealing > 1.0:
            raise ValueError(f"annealing must be > 1, got {self.annealing}")
        for name in ("tolerance", "min_scale"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")


def average_robustly(graph: MotionGraph, information: Array, T_root_map: Array, config: RobustAveragingConfig) -> Array:
    """Fit global motions to relative ones.

    Args:
        graph: The relative motions of one connected component; map 0 is the root and stays.
        information: (E, 3, 3) information of ``v = (x, y, theta)`` in ``T_i_j @ exp(v)``, positive semi-definite.
        T_root_map: (N, 3, 3) initial global motions.
        config: The settings.

    Returns:
        (N, 3, 3) global motions ``T_root_map``; it does not depend on which map is the root but for a common motion.
    """
    T = T_root_map.copy()
    scale = np.inf
    for _ in range(config.max_iterations):
        residuals = _residuals(graph, T)
        squared = np.einsum("ei,eij,ej->e", residuals, information, residuals)
        floor = max(config.min_scale, 3.0 * float(np.sqrt(np.median(squared)))) if len(squared) else config.min_scale
        start = float(np.sqrt(squared.max(initial=0.0)))
        scale = max(floor, min(scale, start) / config.annealing)
        weights = (scale**2 / (scale**2 + squared)) ** 2
        steps = _solve(graph, weights[:, None, None] * information, residuals, T)
        T = se2.exp(steps) @ T
        if np.abs(steps).max(initial=0.0) < config.tolerance and scale <= floor * (1.0 + 1e-9):
            break
    return T


def _residuals(graph: MotionGraph, T: Array) -> Array:
    """(E, 3) ``log(inv(T_i_j) @ inv(T_i) @ T_j)``."""
    i, j = graph.edges.T
    return se2.log(se2.invert(graph.T_i_j) @ se2.invert(T[i]) @ T[j])


def _solve(graph: MotionGraph, information: Array, residuals: Array, T: Array) -> Array:
    """(N, 3) Gauss-Newton steps v of ``exp(v) @ T``; the root's is zero."""
    J = se2.adjoint(se2.invert(T[graph.edges[:, 1]]))
    H = np.swapaxes(J, 1, 2) @ information @ J
    g = (np.swapaxes(J, 1, 2) @ information @ residuals[:, :, None])[:, :, 0]
    return solve_blocks(graph.edges, H, g, len(T))


def solve_blocks(edges: npt.NDArray[np.intp], H: Array, g: Array, num_maps: int) -> Array:
    """Solve for the steps v of N maps that minimise ``sum (v_j - v_i)' H (v_j - v_i) + 2 g' (v_j - v_i)``, v_0 = 0.

    Args:
        edges: (E, 2) maps (i, j).
        H: (E, 3, 3) positive semi-definite blocks.
        g: (E, 3) gradients.
        num_maps: N.

    Returns:
        (N, 3) steps.
    """
    if num_maps < 2 or len(edges) == 0:
        return np.zeros((num_maps, 3))
    i, j = edges.T
    number = np.arange(3)
    at_row = np.concatenate([i, j, i, j])[:, None, None] * 3 + number[:, None]
    at_col = np.concatenate([i, j, j, i])[:, None, None] * 3 + number[None, :]
    values = np.concatenate([H, H, -H, -H])
    rows, cols = (np.broadcast_to(at, values.shape).ravel() for at in (at_row, at_col))
    right = np.zeros((num_maps, 3))
    np.add.at(right, i, g)
    np.add.at(right, j, -g)
    solve = _solve_dense if num_maps <= _DENSE_MAPS else _solve_sparse
    steps = solve(rows, cols, values.ravel(), right.ravel())
    return np.concatenate([np.zeros((1, 3)), steps.reshape(-1, 3)])


def _solve_dense(rows: Numbers, cols: Numbers, values: Array, right: Array) -> Array:
    """Solve for all but the first map, from summands (M,) ``values`` of the normal matrix and its (3 N,) right side."""
    size = len(right)
    normal = np.bincount(rows * size + cols, values, size * size).reshape(size, size)[3:, 3:]
    damping = _DAMPING * max(1.0, float(normal.diagonal().mean()))
    return np.asarray(np.linalg.solve(normal + damping * np.eye(size - 3), right[3:]), np.float64)


def _solve_sparse(rows: Numbers, cols: Numbers, values: Array, right: Array) -> Array:
    """The same for many maps."""
    import scipy.sparse.linalg  # noqa: PLC0415 # slow to import, and few maps do without

    size = len(right)
    normal = scipy.sparse.csc_matrix((values, (rows, cols)), shape=(size, size))[3:, 3:]
    damping = _DAMPING * max(1.0, float(normal.diagonal().mean()))
    regular = scipy.sparse.csc_matrix(normal + damping * scipy.sparse.identity(size - 3, format="csc"))
    return np.asarray(scipy.sparse.linalg.spsolve(regular, right[3:]))
