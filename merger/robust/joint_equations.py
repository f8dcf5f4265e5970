"""What all pairs of placed maps say about the maps' motions, and how much each pair counts.

Maps bend, and walls that were seen twice, from poses that had drifted apart, agree less than those of one visit. So a
pair counts by how closely its walls lie on each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust.alignment_kernel import sum_equations_onto, sum_gaps_onto
from merger.robust.wall_kernels import View, Walls
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointEquationsConfig:
    """How pairs of maps are compared, and weighed.

    Raises:
        ValueError: a setting is out of its range.
    """

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

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("least_cutoff_cells", "gap_cutoff_m", "prior_m", "min_overlap_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if not self.closeness >= 0.0:
            raise ValueError(f"closeness must be >= 0, got {self.closeness}")
        if self.num_points < 10:
            raise ValueError(f"num_points must be >= 10, got {self.num_points}")


class Pairs(NamedTuple):
    """Pairs of maps that overlap."""

    edges: npt.NDArray[np.intp]
    """(E, 2) maps (i, j)."""
    weights: Array
    """(E,) how much each counts."""
    shifts: Array | None = None
    """(E, 3) steps v of ``exp(v) @ T_root_field`` by which each one's second map is moved besides, if any."""


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


def weigh_pairs(structures: Sequence[WallStructure], T: Array, pairs: Pairs, config: JointEquationsConfig) -> Pairs:
    """Let pairs count by how closely their walls agree; the median counts 1.

    Args:
        structures: N maps.
        T: (N, 3, 3) their motions ``T_root_field``.
        pairs: Those that overlap.
        config: The settings.
    """
    if len(pairs.edges) == 0:
        return pairs
    squares, lengths_m = np.zeros(len(pairs.edges)), np.zeros(len(pairs.edges))
    for near in _neighbourhoods(structures, T, pairs, config):
        cutoffs_m = np.full(len(near.numbers), config.gap_cutoff_m)
        squared, met_m = sum_gaps_onto(near.T_owner_partner, near.walls, near.owner, cutoffs_m)
        squares[near.numbers] += squared
        lengths_m[near.numbers] += met_m
    mean = max(float(squares.sum() / max(lengths_m.sum(), 1e-9)), 1e-12)
    apart = np.sqrt((squares / mean + config.prior_m) / (lengths_m + config.prior_m))
    weights = apart**-config.closeness
    return Pairs(pairs.edges, weights / np.median(weights))


def sum_pair_equations(
    structures: Sequence[WallStructure], T: Array, pairs: Pairs, cutoff_m: float, config: JointEquationsConfig
) -> tuple[Array, Array]:
    """Sum up what the walls of each pair say about the steps ``exp(v_i) @ T_root_field``.

    Args:
        structures: N maps.
        T: (N, 3, 3) their motions ``T_root_field``.
        pairs: E pairs.
        cutoff_m: Walls farther apart have no say, metres.
        config: The settings.

    Returns:
        Their blocks (E, 3, 3) H and (E, 3) g, not yet weighted (see `solve_blocks`).
    """
    H, g = np.zeros((len(pairs.edges), 3, 3)), np.zeros((len(pairs.edges), 3))
    for near in _neighbourhoods(structures, T, pairs, config):
        cutoffs_m = np.maximum(cutoff_m, near.least_cutoff_m)
        A, b = sum_equations_onto(near.T_owner_partner, near.walls, near.owner, cutoffs_m)
        J = se2.adjoint(se2.invert(T[near.number]))
        H[near.numbers] += J.T @ A @ J
        g[near.numbers] -= near.sign[:, None] * (b @ J)
    return H, g


def keep_overlapping(pairs: Pairs, H: Array, g: Array, config: JointEquationsConfig) -> tuple[Pairs, Array, Array]:
    """Leave out pairs that hardly overlap, and their blocks."""
    kept = H[:, 0, 0] + H[:, 1, 1] >= config.min_overlap_m
    return Pairs(pairs.edges[kept], pairs.weights[kept]), H[kept], g[kept]


def _neighbourhoods(
    structures: Sequence[WallStructure], T: Array, pairs: Pairs, config: JointEquationsConfig
) -> Iterator[_Neighbourhood]:
    """Every map that has partners, with them."""
    edges = pairs.edges
    cells_m = np.array([item.fields.resolution_m for item in structures])
    for owner, structure in enumerate(structures):
        numbers = np.flatnonzero((edges == owner).any(axis=1))
        partners = edges[numbers].sum(axis=1) - owner
        if len(partners):
            sign = np.where(edges[numbers, 0] == owner, 1.0, -1.0)
            T_partner = T[partners]
            if pairs.shifts is not None:
                T_partner = se2.exp(sign[:, None] * pairs.shifts[numbers]) @ T_partner
            yield _Neighbourhood(
                owner,
                structure.view(config.num_points),
                numbers,
                sign,
                se2.invert(T[owner]) @ T_partner,
                [structures[k].sample(config.num_points) for k in partners],
                config.least_cutoff_cells * np.maximum(cells_m[owner], cells_m[partners]),
            )
