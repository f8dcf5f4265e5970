"""Joint refinement: lay the walls of all placed maps onto each other at once (multi-view trimmed ICP).

Every pair of maps that overlap adds the point-to-wall residuals of both directions; all motions are solved together,
so that errors do not add up along chains. A pair counts by how closely its walls can be laid onto each other: maps
bend, and walls that were seen twice, from poses that had drifted apart, agree less than those of one visit. Source:
the multi-view registration of [Zhu14], with the residuals of `wall_alignment`, and steps that are stretched as in
[Barzilai 1988], since thick walls that overlap pull too little.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.alignment_kernel import sum_equations_onto, sum_gaps_onto
from merger.robust_averaging import solve_blocks
from merger.wall_kernels import View, Walls
from merger.wall_structure import WallStructure

Array = npt.NDArray[np.float64]

_LONGEST_STRETCH = 3.0
"""No step is stretched by more."""


@dataclass(frozen=True)
class JointRefinementConfig:
    """Settings of the joint refinement.

    Raises:
        ValueError: a setting is out of its range.
    """

    cutoffs_m: tuple[float, ...] = (0.3, 0.2, 0.15, 0.1, 0.1)
    """Distance beyond which a wall point has no say, metres, one for each step in which all pairs count alike; > 0."""
    last_cutoff_m: float = 0.08
    """The same for the steps after these, in which pairs count by how closely they agree; > 0."""
    num_last_steps: int = 8
    """How many there are at most, at least 0."""
    least_cutoff_cells: float = 1.6
    """No cut-off is below so many cells of the coarser map of a pair, > 0."""
    gap_cutoff_m: float = 0.2
    """Walls farther apart do not count when it is measured how closely a pair agrees, metres, > 0."""
    closeness: float = 6.0
    """A pair counts by this power of the inverse of how far its walls are apart, >= 0."""
    prior_m: float = 5.0
    """So many metres of wall that are as far apart as all pairs' walls are added to each pair's own, > 0."""
    num_points: int = 2000
    """Wall points of each map that are compared, at least 10."""
    min_overlap_m: float = 1.0
    """Pairs with less agreeing wall are left out, metres, > 0."""
    tolerance: float = 1e-4
    """The last steps end early once none is longer, metres and radians, > 0."""
    metre_variance_m3: float = 2.5e-3
    """Variance of what one metre of wall says about a shift: residuals of 0.05 m, independent every metre; > 0."""
    independent_m: float = 2.0
    """The errors of two maps' walls are not independent: many metres of wall say hardly more than so many; > 0."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not self.cutoffs_m or min(self.cutoffs_m) <= 0.0:
            raise ValueError(f"cutoffs_m must be > 0 m, got {self.cutoffs_m}")
        lengths = ("last_cutoff_m", "least_cutoff_cells", "gap_cutoff_m", "prior_m", "min_overlap_m")
        for name in (*lengths, "tolerance", "metre_variance_m3", "independent_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if self.num_points < 10:
            raise ValueError(f"num_points must be >= 10, got {self.num_points}")
        for name in ("num_last_steps", "closeness"):
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} must be >= 0, got {getattr(self, name)}")


@dataclass(frozen=True)
class JointMotions:
    """The refined motions."""

    T_root_map: Array
    """(N, 3, 3) motions of the maps' frames ``map``; the first map's stays."""
    covariance: Array
    """(N, 3, 3) covariance of ``v = (x, y, theta)`` in ``T_root_map @ exp(v)``, relative to the first map."""


class _Pairs(NamedTuple):
    """Pairs of maps that overlap."""

    edges: npt.NDArray[np.intp]
    """(E, 2) maps (i, j)."""
    weights: Array
    """(E,) how much each counts."""


class _Neighbourhood(NamedTuple):
    """One map, and all that it is compared with."""

    number: int
    """Its number."""
    owner: View
    """The map itself, onto which the others are laid."""
    numbers: npt.NDArray[np.intp]
    """(K,) numbers of its pairs."""
    sign: Array
    """(K,) 1 where it is the first map of the pair, -1 where it is the second one."""
    T_owner_partner: Array
    """(K, 3, 3) motions of the other maps onto it, frames ``field``."""
    walls: list[Walls]
    """Their walls."""
    least_cutoff_m: Array
    """(K,) below which no cut-off is, metres."""


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
    edges = np.array(list(combinations(range(len(structures)), 2)), dtype=np.intp).reshape(-1, 2)
    pairs = _Pairs(edges, np.ones(len(edges)))
    T, pairs = _take_steps(structures, T_root_map @ T_map_field, pairs, config.cutoffs_m, config)
    pairs = _weigh_pairs(structures, T, pairs, config)
    T, pairs = _take_steps(structures, T, pairs, (config.last_cutoff_m,) * config.num_last_steps, config)
    pairs, H, _ = _equations(structures, T, pairs, config.last_cutoff_m, config)
    T_refined = T @ se2.invert(T_map_field)
    return JointMotions(T_refined, _covariance(pairs.edges, H, T_refined, config))


def _take_steps(
    structures: Sequence[WallStructure],
    T: Array,
    pairs: _Pairs,
    cutoffs_m: Sequence[float],
    config: JointRefinementConfig,
) -> tuple[Array, _Pairs]:
    """Refined (N, 3, 3) ``T_root_field``, and the pairs that are left: who does not meet at first never will."""
    taken, stretch = np.zeros((0, 3)), 1.0
    for cutoff_m in cutoffs_m:
        pairs, H, g = _equations(structures, T, pairs, cutoff_m, config)
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


def _weigh_pairs(structures: Sequence[WallStructure], T: Array, pairs: _Pairs, config: JointRefinementConfig) -> _Pairs:
    """Let pairs count by how closely their walls agree; the median counts 1."""
    if len(pairs.edges) == 0:
        return pairs
    squares, lengths_m = np.zeros(len(pairs.edges)), np.zeros(len(pairs.edges))
    for near in _neighbourhoods(structures, T, pairs.edges, config):
        cutoffs_m = np.full(len(near.numbers), config.gap_cutoff_m)
        squared, met_m = sum_gaps_onto(near.T_owner_partner, near.walls, near.owner, cutoffs_m)
        squares[near.numbers] += squared
        lengths_m[near.numbers] += met_m
    mean = max(float(squares.sum() / max(lengths_m.sum(), 1e-9)), 1e-12)
    apart = np.sqrt((squares / mean + config.prior_m) / (lengths_m + config.prior_m))
    weights = apart**-config.closeness
    return _Pairs(pairs.edges, weights / np.median(weights))


def _equations(
    structures: Sequence[WallStructure], T: Array, pairs: _Pairs, cutoff_m: float, config: JointRefinementConfig
) -> tuple[_Pairs, Array, Array]:
    """Pairs that overlap, with their blocks for the steps ``exp(v_i) @ T_root_field``, not yet weighted."""
    H, g = np.zeros((len(pairs.edges), 3, 3)), np.zeros((len(pairs.edges), 3))
    for near in _neighbourhoods(structures, T, pairs.edges, config):
        cutoffs_m = np.maximum(cutoff_m, near.least_cutoff_m)
        A, b = sum_equations_onto(near.T_owner_partner, near.walls, near.owner, cutoffs_m)
        J = se2.adjoint(se2.invert(T[near.number]))
        H[near.numbers] += J.T @ A @ J
        g[near.numbers] -= near.sign[:, None] * (b @ J)
    kept = H[:, 0, 0] + H[:, 1, 1] >= config.min_overlap_m
    return _Pairs(pairs.edges[kept], pairs.weights[kept]), H[kept], g[kept]


def _neighbourhoods(
    structures: Sequence[WallStructure], T: Array, edges: npt.NDArray[np.intp], config: JointRefinementConfig
) -> Iterator[_Neighbourhood]:
    """Every map that has partners, with them."""
    cells_m = np.array([item.fields.resolution_m for item in structures])
    for owner, structure in enumerate(structures):
        numbers = np.flatnonzero((edges == owner).any(axis=1))
        partners = edges[numbers].sum(axis=1) - owner
        if len(partners):
            yield _Neighbourhood(
                owner,
                structure.view(config.num_points),
                numbers,
                np.where(edges[numbers, 0] == owner, 1.0, -1.0),
                se2.invert(T[owner]) @ T[partners],
                [structures[k].sample(config.num_points) for k in partners],
                config.least_cutoff_cells * np.maximum(cells_m[owner], cells_m[partners]),
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
