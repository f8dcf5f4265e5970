"""The answer of the robust method: placements, pairs and reasons in words, from what the stages found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.consensus import Agreement, PairHypotheses
from merger.hypotheses import Hypothesis
from merger.merge_config import MergeConfig
from merger.pair_probability import probability
from merger.result import MapPlacement, Objective, PairResult, PairStatus
from merger.robust_stages import DescribedMap, PlacedGroup, confirmed_motion
from merger.wall_alignment import motion_information

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """All that the stages found."""

    described: Sequence[DescribedMap]
    hypotheses: PairHypotheses
    agreement: Agreement
    groups: tuple[PlacedGroup, ...]


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


def judge_pairs(findings: Findings, config: MergeConfig) -> tuple[PairResult, ...]:
    """Tell of every pair whether its motion is confirmed by the placement, contradicts it, or was not found."""
    tree = _tree_pairs(findings, config)
    where = {member: (group, k) for group in findings.groups for k, member in enumerate(group.members)}
    results = []
    for i, j in combinations(range(len(findings.described)), 2):
        motions = findings.hypotheses[(i, j)]
        confirmed = None
        if where[i][0] is where[j][0]:
            T = where[i][0].T_first_map
            T_i_j = se2.invert(T[where[i][1]]) @ T[where[j][1]]
            confirmed = confirmed_motion(motions, T_i_j, findings.described[j].structure, config)
        results.append(_judge((i, j), confirmed, findings, config, (i, j) in tree))
    return tuple(results)


def measure_objective(pairs: Sequence[PairResult], placements: Sequence[MapPlacement]) -> Objective:
    """How well the global motions explain the confirmed relative ones."""
    place = {item.name: item for item in placements}
    reliable = [pair for pair in pairs if pair.status is PairStatus.RELIABLE]
    if not reliable:
        return Objective()
    scales = []
    for which in ("T_ref_map_initial", "T_ref_map"):
        T_i, T_j = (
            np.stack([getattr(place[getattr(pair, end)], which) for pair in reliable]) for end in ("target", "source")
        )
        T_i_j = np.stack([np.asarray(pair.T_target_source) for pair in reliable])
        residuals = se2.log(se2.invert(T_i_j) @ se2.invert(T_i) @ T_j)
        shift = np.sqrt((residuals[:, :2] ** 2).sum(axis=1).mean())
        scales += [float(shift), float(np.sqrt((residuals[:, 2] ** 2).mean()))]
    return Objective(scales[0], scales[2], scales[1], scales[3], 1, len(reliable))


def _judge(
    pair: tuple[int, int], confirmed: Hypothesis | None, findings: Findings, config: MergeConfig, in_tree: bool
) -> PairResult:
    """The record of one pair."""
    i, j = pair
    target, source = findings.described[i].structure, findings.described[j].structure
    motions = findings.hypotheses[(i, j)]
    shown = confirmed or max(motions, key=lambda item: item.log_odds, default=None)
    if shown is None:
        return PairResult(target.name, source.name, PairStatus.NO_MATCH, "one of the maps has no walls")
    evidence = shown.evidence
    share = evidence.near_m / max(min(target.length_m, source.length_m), 1e-9)
    tightness = min(max(evidence.tight_m / max(evidence.near_m, 1e-9), 1e-6), 1.0)
    rmse_m = config.robust.consensus.pairs.verification.tight_m * math.sqrt(-2.0 * math.log(tightness))
    status, reason = PairStatus.RELIABLE, None
    if confirmed is None:
        rejected = shown.log_odds > 0.0
        status = PairStatus.REJECTED if rejected else PairStatus.NO_MATCH
        reason = "the other maps contradict it" if rejected and _joined(i, j, findings) else explain_doubt(shown)
    return PairResult(
        target.name,
        source.name,
        status,
        reason,
        shown.T_target_source if status is not PairStatus.NO_MATCH else None,
        overlap=min(1.0, share),
        rmse_m=rmse_m,
        agreement=evidence.agreement,
        T_target_source_initial=shown.T_target_source if status is not PairStatus.NO_MATCH else None,
        information=motion_information(target, source, shown.T_target_source, config.robust.joint.metre_variance_m3),
        in_tree=in_tree and confirmed is not None,
    )


def explain_doubt(hypothesis: Hypothesis) -> str:
    """Why a motion is not probable enough, in words."""
    evidence = hypothesis.evidence
    head = f"its best motion has a probability of {probability(hypothesis.log_odds):.2f}"
    if evidence.near_m < 3.0:
        return f"{head}: only {evidence.near_m:.1f} m of walls agree"
    if evidence.agreement < 0.95:
        return f"{head}: {100.0 * (1.0 - evidence.agreement):.0f} % of the compared walls lie in free space"
    if hypothesis.rival_score_m > 0.6 * hypothesis.score_m:
        return f"{head}: another motion fits about as well"
    return (
        f"{head}: {evidence.near_m:.1f} m of agreeing walls and {evidence.free_m2:.0f} m2 of shared floor are too few"
    )


def _joined(i: int, j: int, findings: Findings) -> bool:
    return any(i in group.members and j in group.members for group in findings.groups)


def _why_alone(number: int, findings: Findings) -> str:
    """Why no motion joins a map to a group."""
    names = [item.structure.name for item in findings.described]
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


def _tree_pairs(findings: Findings, config: MergeConfig) -> set[tuple[int, int]]:
    """The pair with most agreeing wall between the two sides of each join, among the confirmed ones."""
    place = {m: (g, k) for g in findings.groups for k, m in enumerate(g.members)}
    tree = set()
    for join in findings.agreement.joins:
        best: tuple[float, tuple[int, int]] | None = None
        for a in join.members:
            for b in join.others:
                i, j = min(a, b), max(a, b)
                group = place[i][0]
                T_i_j = se2.invert(group.T_first_map[place[i][1]]) @ group.T_first_map[place[j][1]]
                found = confirmed_motion(findings.hypotheses[(i, j)], T_i_j, findings.described[j].structure, config)
                if found is not None and (best is None or found.score_m > best[0]):
                    best = (found.score_m, (i, j))
        if best is not None:
            tree.add(best[1])
    return tree


def _relative_covariance(group: PlacedGroup, root: int, member: int) -> Array:
    """Covariance of a map relative to the reference: both ends' spread, as if independent."""
    if member == root:
        return np.zeros((3, 3))
    T_member_root = se2.invert(group.T_first_map[member]) @ group.T_first_map[root]
    J = se2.adjoint(T_member_root)
    return np.asarray(group.covariance[member] + J @ group.covariance[root] @ J.T)
