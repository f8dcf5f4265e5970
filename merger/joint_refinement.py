"""Joint refinement: lay the walls of all placed maps onto each other at once (multi-view trimmed ICP).

Every pair of maps that overlap adds the point-to-wall residuals of both directions; all motions are solved together,
so that errors do not add up along chains. Source: the multi-view registration of [Zhu14], with the residuals of
`wall_alignment`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust_averaging import solve_blocks
from merger.wall_alignment import wall_equations
from merger.wall_structure import WallStructure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointRefinementConfig:
    """Settings of the joint refinement.

    Raises:
        ValueError: a setting is out of its range.
    """

    cutoffs_m: tuple[float, ...] = (0.3, 0.25, 0.2, 0.2, 0.15, 0.15, 0.12, 0.1, 0.1)
    """Distance beyond which a wall point has no say, metres, one for each step; > 0."""
    min_overlap_m: float = 1.0
    """Pairs with less agreeing wall are left out, metres, > 0."""
    tolerance: float = 1e-5
    """Steps end early once none is longer at the last cut-off, metres and radians, > 0."""
    metre_variance_m3: float = 2.5e-3
    """Variance of what one metre of wall says about a shift: residuals of 0.05 m, independent every metre; > 0."""
    independent_m: float = 2.0
    """The errors of two maps' walls are not independent: many metres of wall say hardly more than so many; > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.cutoffs_m or min(self.cutoffs_m) <= 0.0:
            raise ValueError(f"cutoffs_m must be > 0 m, got {self.cutoffs_m}")
        for name in ("min_overlap_m", "tolerance", "metre_variance_m3", "independent_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class JointMotions:
    """The refined motions."""

    T_root_map: Array
    """(N, 3, 3) motions of the maps' frames ``map``; the first map's stays."""
    covariance: Array
    """(N, 3, 3) covariance of ``v = (x, y, theta)`` in ``T_root_map @ exp(v)``, relative to the first map."""


def refine_jointly(
    structures: Sequence[WallStructure], T_root_map: Array, config: JointRefinementConfig
) -> JointMotions:
    """Refine the motions of one component.

    Args:
        structures: N maps.
        T_root_map: (N, 3, 3) their motions, right to a few decimetres.
        config: The settings.

    Returns:
        Refined motions and their covariance.
    """
    T_map_field = np.stack([item.T_map_field for item in structures])
    T = T_root_map @ T_map_field
    pairs = np.array(list(combinations(range(len(structures)), 2)), dtype=np.intp).reshape(-1, 2)
    H = np.zeros((0, 3, 3))
    for cutoff_m in config.cutoffs_m:
        edges, H, g = _equations(structures, T, pairs, cutoff_m, config)
        steps = solve_blocks(edges, H, g, len(T))
        T = se2.exp(steps) @ T
        pairs = edges  # the cut-off falls: who does not meet at the first one never will
        if cutoff_m == config.cutoffs_m[-1] and np.abs(steps).max(initial=0.0) < config.tolerance:
            break
    T_refined = T @ se2.invert(T_map_field)
    return JointMotions(T_refined, _covariance(edges, H, T_refined, config))


def _equations(
    structures: Sequence[WallStructure],
    T: Array,
    pairs: npt.NDArray[np.intp],
    cutoff_m: float,
    config: JointRefinementConfig,
) -> tuple[npt.NDArray[np.intp], Array, Array]:
    """Pairs that overlap, with their blocks for the steps ``exp(v_i) @ T_root_field``."""
    edges, blocks, gradients = [], [], []
    for i, j in pairs.tolist():
        A, b = wall_equations(structures[i], structures[j], se2.invert(T[i]) @ T[j], cutoff_m)
        if A[0, 0] + A[1, 1] < config.min_overlap_m:
            continue
        J = se2.adjoint(se2.invert(T[i]))
        edges.append((i, j))
        blocks.append(J.T @ A @ J)
        gradients.append(-J.T @ b)
    shape = (len(edges), 3)
    return (
        np.array(edges, dtype=np.intp).reshape(-1, 2),
        np.array(blocks).reshape(*shape, 3),
        np.array(gradients).reshape(shape),
    )


def _covariance(edges: npt.NDArray[np.intp], H: Array, T: Array, config: JointRefinementConfig) -> Array:
    """Covariance of every map relative to the first, from the normal equations of the last step."""
    count = len(T)
    normal = np.zeros((count, count, 3, 3))
    lengths_m = 0.5 * (H[:, 0, 0] + H[:, 1, 1])
    limited = H / (1.0 + lengths_m / config.independent_m)[:, None, None]
    for (i, j), block in zip(edges.tolist(), limited, strict=True):
        normal[i, i] += block
        normal[j, j] += block
        normal[i, j] -= block
        normal[j, i] -= block
    dense = normal.transpose(0, 2, 1, 3).reshape(3 * count, 3 * count)[3:, 3:]
    inverse = np.linalg.pinv(dense, hermitian=True) * config.metre_variance_m3
    covariance = np.zeros((count, 3, 3))
    for k in range(1, count):
        J = se2.adjoint(se2.invert(T[k]))
        covariance[k] = J @ inverse[3 * k - 3 : 3 * k, 3 * k - 3 : 3 * k] @ J.T
    return covariance
