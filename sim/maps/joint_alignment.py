"""Joint alignment of the scans of a submap: all overlapping pairs at once, held together by odometry.

Sources: Lu and Milios, "Globally consistent range scan alignment for environment mapping", 1997; point-to-line
residuals with a Geman-McClure kernel, whose reach shrinks from step to step.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from merger import se2
from sim.maps.scan_pairs import pair_equations
from sim.robot_run import LidarSpec

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointAlignmentConfig:
    """How scans are aligned with each other.

    Raises:
        ValueError: a value is out of its range.
    """

    num_iterations: int = 6
    """Gauss-Newton steps."""
    iterations_per_choice: int = 3
    """Steps after which the pairs are chosen anew."""
    num_before: int = 2
    """Each scan is compared with so many before it, however far."""
    num_others: int = 80
    """Each scan is compared with so many of the others, evenly spread from the nearest to the farthest ..."""
    others_m: float = 20.0
    """... within this distance: near ones hold it firmly, far ones hold its heading."""
    first_reach_m: float = 0.4
    """Largest distance between corresponding points at the first step: what matching in turn may be off by."""
    last_reach_m: float = 0.15
    """The same at the last step: farther away lie other things, which bend maps that were right."""
    sigma_m: float = 0.03
    """Standard deviation of a residual."""
    pair_weight: float = 0.1
    """Weight of a correspondence: neighbouring beams err together."""
    min_correspondences: int = 25
    """A pair with fewer is not used."""

    def __post_init__(self) -> None:
        """Refuse what cannot align."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0 < value < math.inf:
                raise ValueError(f"joint alignment: {item.name} must be > 0, got {value:g}")


def align_scans(
    surfaces: Array, lidar: LidarSpec, T_map_lidar: Array, odometry: tuple[Array, Array], config: JointAlignmentConfig
) -> Array:
    """Poses of all scans that fit together best, the first one kept.

    Args:
        surfaces: (K, B, 4) ends and normals: `sim.maps.scan_surfaces.fit_normals`.
        lidar: The lidar.
        T_map_lidar: (K, 3, 3) poses to start from.
        odometry: (K - 1, 3, 3) motions of the lidar from each scan to the next one, (K - 1, 2) their standard
            deviations in metres and radians.
        config: How.

    Returns:
        (K, 3, 3) poses ``T_map_lidar``.
    """
    if len(T_map_lidar) < 2:
        return T_map_lidar
    angles = (lidar.angle_min_rad, lidar.angle_increment_rad)
    T, pairs = T_map_lidar, np.zeros((0, 2), dtype=np.int64)
    for k, reach_m in enumerate(np.geomspace(config.first_reach_m, config.last_reach_m, config.num_iterations)):
        if k % config.iterations_per_choice == 0:
            pairs = _pairs_of_scans(T, config)
        A, g, counts = pair_equations(surfaces, T, pairs, angles, (reach_m, config.sigma_m))
        kept = counts >= config.min_correspondences
        edges = (pairs[kept], config.pair_weight * A[kept], config.pair_weight * g[kept])
        if k % config.iterations_per_choice == 0:
            pairs = pairs[2 * counts >= config.min_correspondences]  # what hardly overlaps is not looked at again
        T = se2.exp(_solve(len(T), edges, _odometry_edges(T, odometry))) @ T
    return T


def _pairs_of_scans(T_map_lidar: Array, config: JointAlignmentConfig) -> npt.NDArray[np.int64]:
    """(M, 2) pairs of scans to compare, each in one of its two directions by turns."""
    positions = T_map_lidar[:, :2, 2]
    count = len(positions)
    pairs = [np.stack([np.arange(k, count), np.arange(count - k)], axis=-1) for k in range(1, config.num_before + 1)]
    for i in range(count):
        distance_m = np.hypot(*(positions - positions[i]).T)
        order = np.argsort(distance_m, kind="stable")
        others = order[(distance_m[order] <= config.others_m) & (order != i)]
        spread = np.linspace(0, len(others) - 1, min(config.num_others, len(others))).astype(np.int64)
        pairs.append(np.stack([np.full(len(spread), i), others[spread]], axis=-1))
    low, high = np.unique(np.sort(np.concatenate(pairs), axis=1), axis=0).T
    swapped = (low + high) % 2 == 1
    return np.stack([np.where(swapped, high, low), np.where(swapped, low, high)], axis=-1)


def _odometry_edges(T: Array, odometry: tuple[Array, Array]) -> tuple[npt.NDArray[np.int64], Array, Array]:
    """The odometry as edges (k + 1, k): residual log(inv(Z) inv(T_k) T_k+1)."""
    T_before_after, sigmas = odometry
    residual = se2.log(se2.invert(T_before_after) @ se2.invert(T[:-1]) @ T[1:])
    J = se2.adjoint(se2.invert(T[1:]))
    information = 1.0 / np.stack([sigmas[:, 0], sigmas[:, 0], sigmas[:, 1]], axis=-1) ** 2
    J_information = np.swapaxes(J, -1, -2) * information[:, None, :]
    index = np.arange(len(T) - 1)
    return np.stack([index + 1, index], axis=-1), J_information @ J, (J_information @ residual[..., None])[..., 0]


def _solve(count: int, *edge_sets: tuple[npt.NDArray[np.int64], Array, Array]) -> Array:
    """(count, 3) step of all poses but the first, which stays."""
    pairs, A, g = (np.concatenate(parts) for parts in zip(*edge_sets, strict=True))
    i, j = pairs[:, 0], pairs[:, 1]
    rows = np.concatenate([i, j, i, j])
    columns = np.concatenate([i, j, j, i])
    blocks = np.concatenate([A, A, -A, -A])
    entry = np.arange(3)
    row = np.broadcast_to((3 * rows)[:, None, None] + entry[:, None], blocks.shape)
    column = np.broadcast_to((3 * columns)[:, None, None] + entry, blocks.shape)
    H = sparse.coo_matrix((blocks.ravel(), (row.ravel(), column.ravel())), shape=(3 * count, 3 * count)).tocsc()
    gradient = np.zeros((count, 3))
    np.add.at(gradient, i, g)
    np.add.at(gradient, j, -g)
    step = np.zeros((count, 3))
    # H is symmetric and positive definite: an order of that kind, and no pivoting, take half the time.
    factors = linalg.splu(H[3:, 3:], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    step[1:] = -factors.solve(gradient.ravel()[3:]).reshape(-1, 3)
    return step
