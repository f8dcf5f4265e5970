"""Groups of maps that lie fixed to each other, and what the motions of their maps say about two groups."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.compositing import CompositingConfig, composite_maps
from merger.grid_map import GridMap
from merger.robust.hypotheses import Hypothesis
from merger.robust.wall_structure import WallStructure, WallStructureConfig, extract_structure

Array = npt.NDArray[np.float64]

PairHypotheses = dict[tuple[int, int], tuple[Hypothesis, ...]]
"""Motions in question of each pair ``(i, j)``, i < j: j moves onto i."""


@dataclass(frozen=True)
class Formation:
    """Maps that lie fixed to each other."""

    members: tuple[int, ...]
    """Numbers of the maps, rising; the first one's frame is the group's."""
    T_group_map: Array
    """(M, 3, 3) their motions."""

    def place_of(self, number: int) -> Array:
        """(3, 3) motion of one of its maps."""
        return np.asarray(self.T_group_map[self.members.index(number)])


@dataclass(frozen=True)
class Group(Formation):
    """A formation that can be compared with others."""

    structure: WallStructure
    """Walls and free space of all members together, frame ``map`` of the first."""
    grid: GridMap | None = None
    """The cells of all members together, in the same frame; None if the group never grows."""


@dataclass(frozen=True)
class Voice:
    """What one motion of two maps says about their groups."""

    pair: tuple[int, int]
    """The maps: one of the group that stays, one of the group that moves."""
    T_a_b: Array
    """(3, 3) motion of the one group into the other."""
    hypothesis: Hypothesis
    """Whose motion it is."""


def voices_between(a: Formation, b: Formation, hypotheses: PairHypotheses, min_log_odds: float) -> list[Voice]:
    """What the motions of all pairs of maps, if they are at least so probable, say about two groups."""
    voices = []
    for (i, T_a_i), (j, T_b_j) in product(
        zip(a.members, a.T_group_map, strict=True), zip(b.members, b.T_group_map, strict=True)
    ):
        for hypothesis in hypotheses.get((min(i, j), max(i, j)), ()):
            if hypothesis.log_odds >= min_log_odds:
                T_i_j = hypothesis.T_target_source if i < j else se2.invert(hypothesis.T_target_source)
                voices.append(Voice((i, j), T_a_i @ T_i_j @ se2.invert(T_b_j), hypothesis))
    return voices


def join_formations(a: Formation, b: Formation, T_a_b: Array) -> Formation:
    """Put two formations into one, in the frame of its first member."""
    members = np.array(a.members + b.members)
    T_a_map = np.concatenate([a.T_group_map, T_a_b @ b.T_group_map])
    order = np.argsort(members)
    return Formation(tuple(int(n) for n in members[order]), se2.invert(T_a_map[order[0]]) @ T_a_map[order])


def describe_group(formation: Formation, base: Group, maps: Sequence[GridMap], config: WallStructureConfig) -> Group:
    """Give a formation the cells and the structure of all its maps together.

    Args:
        formation: The maps.
        base: Those of them that lay fixed to each other before, the first one included: their cells stay in place.
        maps: All maps, by number.
        config: How walls are described.
    """
    own, T = [maps[number] for number in formation.members], formation.T_group_map
    cell_m, name = max(min(grid.resolution_m for grid in own), config.spacing_m), own[0].name
    if base.grid is not None and base.grid.resolution_m == cell_m:  # only the others have to be added
        others = [k for k, number in enumerate(formation.members) if number not in base.members]
        own, T = [base.grid, *(own[k] for k in others)], np.concatenate([np.eye(3)[None], T[others]])
    grid = replace(composite_maps(own, T, own[0].T_map_grid, cell_m, CompositingConfig()), name=name)
    return Group(formation.members, formation.T_group_map, extract_structure(grid, config), grid)
