"""Motions in question with their truth: of pairs, of groups of maps, and of the steps that a consensus would take.

Maps that are distorted themselves are left out: where they belong is not known well enough to call a motion wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.grid_map import GridMap
from merger.merge_config import MergeConfig
from merger.robust.consensus import Agreement, ConsensusConfig, Join, grow_groups
from merger.robust.hypotheses import Hypothesis
from merger.robust.map_group import Group
from merger.robust.pair_probability import features_of
from merger.robust.stages import describe_maps, search_all_pairs
from merger.robust.strain import StrainConfig
from sim.datasets.dataset import Dataset, read_dataset

Array = npt.NDArray[np.float64]
RIGHT_M, RIGHT_DEG = 0.5, 3.0
"""A motion is right within these."""
WRONG_M, WRONG_DEG = 0.7, 6.0
"""It is wrong beyond one of these; between, it is left out."""
MAX_DISTORTION_M = 0.15
"""Maps that are bent by more are left out."""
_OPEN_LOG_ODDS = -1.0
"""The consensus goes on until here, far below what it would accept, so that its wrong steps show."""
_STRANGERS = 4
"""Maps of each of two neighbouring datasets that are mixed."""


@dataclass(frozen=True)
class Samples:
    """S motions in question, and J steps of consensus, with their truth."""

    features: Array
    """(S, F) see `merger.robust.pair_probability.features_of`."""
    right: npt.NDArray[np.bool_]
    """(S,) whether the motion is right."""
    is_best: npt.NDArray[np.bool_]
    """(S,) whether it is the best of its pair, or of its groups."""
    building: npt.NDArray[np.int64]
    """(S,) number of the building."""
    pair: npt.NDArray[np.int64]
    """(S,) number of the pair of maps; -1 for motions of groups."""
    overlap: Array
    """(S,) true overlap of the pair in the better direction; NaN for groups."""
    step_log_odds: Array
    """(J,) log-odds of the motions that were steps, as the current coefficients give them."""
    step_right: npt.NDArray[np.bool_]
    """(J,) whether they were right; steps after a wrong one of the same group are left out."""
    step_building: npt.NDArray[np.int64]
    """(J,) number of the building."""


@dataclass
class _Rows:
    """Samples as they come."""

    motions: list[tuple[Array, bool, bool, int, int, float]]
    steps: list[tuple[float, bool, int]]
    num_pairs: int = 0


def collect_samples(datasets: Sequence[Path]) -> tuple[Samples, list[str]]:
    """Search all datasets, and mixtures of the first maps of neighbouring ones.

    Args:
        datasets: Dataset folders.

    Returns:
        The samples, and the names of the buildings.

    Raises:
        ValueError: a folder is no dataset.
    """
    read = [read_dataset(path) for path in datasets]
    names = sorted({_building(item) for item in read})
    rows = _Rows([], [])
    for item in read:
        sound = np.flatnonzero(item.truth.distortion_rms_m <= MAX_DISTORTION_M)
        overlap = np.maximum(item.truth.overlap, item.truth.overlap.T)[np.ix_(sound, sound)]
        _add(rows, [item.maps[k] for k in sound], item.truth.T_world_map[sound], overlap, names.index(_building(item)))
    for one, other in pairwise(read):
        if _building(one) != _building(other):
            chosen = [*one.maps[:_STRANGERS], *other.maps[:_STRANGERS]]
            maps = [replace(grid, name=f"{k:02d}") for k, grid in enumerate(chosen)]
            _add_strangers(rows, maps, len(one.maps[:_STRANGERS]), names.index(_building(one)))
    features, right, is_best, building, pair, overlap = (np.array(column) for column in zip(*rows.motions, strict=True))
    steps = np.array(rows.steps, dtype=np.float64).reshape(-1, 3)
    columns = (features, right, is_best, building, pair, overlap)
    return Samples(*columns, steps[:, 0], steps[:, 1].astype(np.bool_), steps[:, 2].astype(np.int64)), names


def _building(dataset: Dataset) -> str:
    """A log (variants of it are called ``LOG_...``), a named world, or a generated one with its seed."""
    config: dict[str, Any] = dataset.config
    if config["source"]["path"]:
        return Path(config["source"]["path"]).name.split(".")[0].split("_")[0]
    return f"{config['world']} {config['seed']}" if config["world"] == "office" else str(config["world"])


def _add(rows: _Rows, maps: Sequence[GridMap], T_world_map: Array, overlap: Array, building: int) -> None:
    """Add the motions and the steps of the maps of one dataset."""
    if len(maps) < 2:
        return
    described = describe_maps(maps, MergeConfig(), _quiet)
    structures = [item.structure for item in described]
    hypotheses = search_all_pairs(described, MergeConfig(), _quiet)
    T = T_world_map
    for (i, j), motions in hypotheses.items():
        T_i_j = se2.invert(T[i]) @ T[j]
        for motion in motions:
            _add_motion(rows, motion, judge(motion, T_i_j, structures[j].center_map), building, float(overlap[i, j]))
        rows.num_pairs += 1

    def watch(a: Group, b: Group, motions: Sequence[Hypothesis]) -> None:
        if _is_sound(a.T_group_map, T[list(a.members)]) and _is_sound(b.T_group_map, T[list(b.members)]):
            T_a_b = se2.invert(T[a.members[0]]) @ T[b.members[0]]
            for motion in motions:
                _add_motion(rows, motion, judge(motion, T_a_b, b.structure.center_map), building, np.nan)

    agreement = grow_groups(maps, structures, hypotheses, _open_consensus(), watch)
    rows.steps += [
        (step.motion_log_odds, right, building)
        for step in agreement.joins
        if (right := _judge_step(step, agreement, T)) is not None
    ]


def _add_strangers(rows: _Rows, maps: Sequence[GridMap], num_first: int, building: int) -> None:
    """Add motions between maps of two buildings, all of them wrong, and the steps that would join the buildings."""
    described = describe_maps(maps, MergeConfig(), _quiet)
    hypotheses = search_all_pairs(described, MergeConfig(), _quiet)
    for (i, j), motions in hypotheses.items():
        if i < num_first <= j:
            for motion in motions:
                _add_motion(rows, motion, False, building, 0.0)
            rows.num_pairs += 1
    joins = grow_groups(maps, [item.structure for item in described], hypotheses, _open_consensus()).joins
    sides = [({k < num_first for k in step.members}, {k < num_first for k in step.others}, step) for step in joins]
    rows.steps += [(step.motion_log_odds, False, building) for a, b, step in sides if len(a) == len(b) == 1 and a != b]


def _open_consensus() -> ConsensusConfig:
    never = StrainConfig(sure_log_odds=np.inf)
    consensus = replace(MergeConfig().robust.consensus, min_log_odds=_OPEN_LOG_ODDS, strain=never)
    return replace(consensus, cycle_log_odds=0.0, echo_log_odds=0.0)


def _add_motion(rows: _Rows, motion: Hypothesis, verdict: bool | None, building: int, overlap: float) -> None:
    if verdict is not None:
        features = features_of(motion.evidence, motion.score_m, motion.rival_score_m)
        pair, is_best = -1 if np.isnan(overlap) else rows.num_pairs, motion.score_m >= motion.rival_score_m
        rows.motions.append((features, verdict, is_best, building, pair, overlap))


def judge(motion: Hypothesis, T_true: Array, center: Array) -> bool | None:
    """Whether a motion is right at the source's (2,) centre; None between right and wrong."""
    T = motion.T_target_source
    ends = (se2.transform_points(motion, center[None])[0] for motion in (T, T_true))
    shift_m = float(np.linalg.norm(np.subtract(*ends)))
    turn_deg = float(np.degrees(np.abs(se2.angle_of(se2.invert(T_true) @ T))))
    if shift_m < RIGHT_M and turn_deg < RIGHT_DEG:
        return True
    return False if shift_m > WRONG_M or turn_deg > WRONG_DEG else None


def _judge_step(step: Join, agreement: Agreement, T_world_map: Array) -> bool | None:
    """Whether a step of the consensus was right; None if one of its groups was wrong before."""
    group = next(group for group in agreement.groups if set(step.members) <= set(group.members))
    T = dict(zip(group.members, group.T_group_map, strict=True))
    sides = [list(step.members), list(step.others)]
    sound = [_is_sound(np.stack([T[k] for k in side]), T_world_map[side]) for side in (*sides, sides[0] + sides[1])]
    return sound[2] if sound[0] and sound[1] else None


def _is_sound(T_group_map: Array, T_world_map: Array) -> bool:
    """Whether (M, 3, 3) motions lie as they should: no map is farther off, seen from the first one, than `WRONG_M`."""
    T = se2.invert(T_world_map) @ T_world_map[0] @ se2.invert(T_group_map[0]) @ T_group_map
    return bool(
        (np.hypot(T[:, 0, 2], T[:, 1, 2]) < WRONG_M).all() and (abs(se2.angle_of(T)) < np.radians(WRONG_DEG)).all()
    )


def _quiet(stage: str, done: int, total: int) -> None:
    """Nobody watches."""
