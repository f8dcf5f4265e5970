"""The answer of the robust method: placements with confidence and covariance, and why maps were left out."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.merge_config import MergeConfig
from merger.result import MapPlacement
from merger.robust.pair_answer import Findings, explain_doubt
from merger.robust.pair_probability import probability
from merger.robust.stages import PlacedGroup

Array = npt.NDArray[np.float64]


def place_groups(findings: Findings, config: MergeConfig, scales: Array | None = None) -> tuple[MapPlacement, ...]:
    """Express every map's motion in the frame of its component's reference; in the order of the maps.

    Args:
        findings: What the stages found.
        config: The settings.
        scales: (N,) factors that the maps' metres were multiplied by; None if they were not estimated.
    """
    names = [item.structure.name for item in findings.described]
    confidence = _confidences(findings)
    placements: dict[int, MapPlacement] = {}
    for number, group in enumerate(findings.groups):
        if len(group.members) == 1:
            only = group.members[0]
            reason = _why_alone(only, findings)
            placements[only] = MapPlacement(names[only], False, number, reason=reason)
            continue
        root = next((k for k, member in enumerate(group.members) if names[member] == config.reference), 0)
        for k, member in enumerate(group.members):
            T, T_initial = (
                np.eye(3) if k == root else se2.invert(motions[root]) @ motions[k]
                for motions in (group.T_first_map, group.T_first_map_initial)
            )
            spread = _relative_covariance(group, root, k)
            placements[member] = MapPlacement(
                names[member], True, number, T, T_initial, confidence[member], spread, None
            )
    ordered = [placements[index] for index in range(len(names))]
    if scales is not None:
        ordered = [replace(item, scale=float(scale)) for item, scale in zip(ordered, scales, strict=True)]
    return tuple(ordered)


def _why_alone(number: int, findings: Findings) -> str:
    """Why no motion joins a map to a group."""
    names = [item.structure.name for item in findings.described]
    if any(number in join.members + join.others for join in findings.agreement.taken_back):
        return "sure motions to other maps contradict the one that joined it"
    own = [(a, b, motion) for a, b, motion in findings.agreement.open_motions if (number,) in (a, b)]
    if not own:
        return "there is no other map" if len(names) == 1 else "it has no walls that could be compared"
    a, b, motion = max(own, key=lambda item: item[2].log_odds)
    other = b if a == (number,) else a
    return f"no motion onto another map is sure enough; onto '{names[other[0]]}', {explain_doubt(motion)}"


def _confidences(findings: Findings) -> list[float]:
    """Probability of each map's placement: every join that its smaller side hangs on must be right."""
    log_confidence = np.zeros(len(findings.described))
    for join in findings.agreement.joins:
        smaller = join.others if len(join.others) <= len(join.members) else join.members
        log_confidence[list(smaller)] += math.log(max(probability(join.log_odds), 1e-9))
        if len(join.members) == len(join.others) == 1:
            log_confidence[list(join.members)] += math.log(max(probability(join.log_odds), 1e-9))
    return [float(value) for value in np.exp(log_confidence)]


def _relative_covariance(group: PlacedGroup, root: int, member: int) -> Array:
    """(3, 3) covariance of a map relative to the reference, which they share part of their errors with."""
    J = -se2.adjoint(se2.invert(group.T_first_map[member]) @ group.T_first_map[root])
    C = group.covariance
    if member == root:
        return np.zeros((3, 3))
    crossed = C[member, root] @ J.T
    return np.asarray(C[member, member] + crossed + crossed.T + J @ C[root, root] @ J.T)
