"""Joint refinement: lay the walls of all placed maps onto each other at once (multi-view trimmed ICP).

Every pair of maps that overlap adds the point-to-wall residuals of both directions; all motions are solved together,
so that errors do not add up along chains. A pair counts by how closely its walls can be laid onto each other: maps
bend, and walls that were seen twice, from poses that had drifted apart, agree less than those of one visit. Only the
faces of walls are compared. Source: the multi-view registration of [Zhu14], with the residuals of `wall_alignment`,
and steps that are stretched as in [Barzilai 1988], since rough walls that overlap pull too little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.averaging import solve_blocks
from merger.robust.joint_covariance import JointCovarianceConfig, estimate_covariance
from merger.robust.joint_equations import (
    JointEquationsConfig,
    Pairs,
    keep_overlapping,
    sum_pair_equations,
    weigh_pairs,
)
from merger.robust.wall_faces import extract_faces
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

_LONGEST_STRETCH = 3.0
"""No step is stretched by more."""


@dataclass(frozen=True)
class JointRefinementConfig:
    """Settings of the joint refinement.

    Raises:
        ValueError: a setting is out of its range.
    """

    equations: JointEquationsConfig = field(default_factory=JointEquationsConfig)
    """What pairs of maps say, and how much each counts."""
    cutoffs_m: tuple[float, ...] = (0.3, 0.2, 0.15, 0.1, 0.1)
    """Distance beyond which a wall point has no say, metres, one for each step in which all pairs count alike; > 0."""
    last_cutoff_m: float = 0.08
    """The same for the steps after these, in which pairs count by how closely they agree; > 0."""
    num_last_steps: int = 12
    """How many there are at most, at least 0."""
    tolerance: float = 3e-5
    """The last steps end early once none is longer, metres and radians, > 0."""
    metre_variance_m3: float = 2.5e-3
    """Variance of what one metre of wall of a pair says about a shift: 0.05 m, independent every metre; > 0."""
    covariance: JointCovarianceConfig = field(default_factory=JointCovarianceConfig)
    """How certain the motions are."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.cutoffs_m or min(self.cutoffs_m) <= 0.0:
            raise ValueError(f"cutoffs_m must be > 0 m, got {self.cutoffs_m}")
        for name in ("last_cutoff_m", "tolerance", "metre_variance_m3"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.num_last_steps < 0:
            raise ValueError(f"num_last_steps must be >= 0, got {self.num_last_steps}")


@dataclass(frozen=True)
class JointMotions:
    """The refined motions."""

    T_root_map: Array
    """(N, 3, 3) motions of the maps' frames ``map``; the first map's stays."""
    covariance: Array
    """(N, N, 3, 3) covariance of ``v = (x, y, theta)`` in ``T_root_map @ exp(v)``, relative to the first map."""


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
    structures = [extract_faces(item) for item in structures]
    T_map_field = np.stack([item.T_map_field for item in structures])
    edges = np.array(list(combinations(range(len(structures)), 2)), dtype=np.intp).reshape(-1, 2)
    pairs = Pairs(edges, np.ones(len(edges)))
    T, pairs = _take_steps(structures, T_root_map @ T_map_field, pairs, config.cutoffs_m, config)
    pairs = weigh_pairs(structures, T, pairs, config.equations)
    T, pairs = _take_steps(structures, T, pairs, (config.last_cutoff_m,) * config.num_last_steps, config)
    covariance = _covariance(structures, T, T_map_field, pairs, config)
    return JointMotions(T @ se2.invert(T_map_field), covariance)


def _take_steps(
    structures: Sequence[WallStructure],
    T: Array,
    pairs: Pairs,
    cutoffs_m: Sequence[float],
    config: JointRefinementConfig,
) -> tuple[Array, Pairs]:
    """Refined (N, 3, 3) ``T_root_field``, and the pairs that are left: who does not meet at first never will."""
    taken, stretch = np.zeros((0, 3)), 1.0
    for cutoff_m in cutoffs_m:
        H, g = sum_pair_equations(structures, T, pairs, cutoff_m, config.equations)
        pairs, H, g = keep_overlapping(pairs, H, g, config.equations)
        steps = solve_blocks(pairs.edges, pairs.weights[:, None, None] * H, pairs.weights[:, None] * g, len(T))
        if len(taken):
            stretch = _stretch(taken, steps)
        taken = stretch * steps
        T = se2.exp(taken) @ T
        if cutoff_m == config.last_cutoff_m and np.abs(steps).max(initial=0.0) < config.tolerance:
            break
    return T, pairs


def _stretch(taken: Array, steps: Array) -> float:
    """How far to go along the steps, by how much the last ones, which were taken, made them shorter."""
    shortened = float(((taken - steps) * taken).sum())
    length = float((taken * taken).sum())
    return min(max(length / shortened, 1.0), _LONGEST_STRETCH) if shortened > 0.0 else 1.0


def _covariance(
    structures: Sequence[WallStructure], T: Array, T_map_field: Array, pairs: Pairs, config: JointRefinementConfig
) -> Array:
    """(N, N, 3, 3) covariance of the refined (N, 3, 3) ``T_root_field``, as steps in the frames ``map``."""

    def equations(shifts: Array) -> tuple[Array, Array]:
        moved = pairs._replace(shifts=shifts)
        return sum_pair_equations(structures, T, moved, config.last_cutoff_m, config.equations)

    pairs, _, _ = keep_overlapping(pairs, *equations(np.zeros((len(pairs.edges), 3))), config.equations)
    cells_m = np.array([item.fields.resolution_m for item in structures])
    spread = estimate_covariance(pairs, equations, cells_m, config.covariance)
    J = se2.adjoint(se2.invert(T @ se2.invert(T_map_field)))
    return np.asarray(J[:, None] @ spread @ np.swapaxes(J, 1, 2)[None])
