"""What the robust method tells of pairs: confirmed by the placement, contradicted by it, or not found; with reasons."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.merge_config import MergeConfig
from merger.result import MapPlacement, Objective, PairResult, PairStatus
from merger.robust.consensus import Agreement
from merger.robust.hypotheses import Hypothesis, distinct_motions, judge_motions
from merger.robust.map_group import PairHypotheses
from merger.robust.pair_probability import probability
from merger.robust.stages import DescribedMap, PlacedGroup, confirmed_motion
from merger.robust.verification import measure_evidence
from merger.robust.wall_alignment import align_walls, motion_information

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """All that the stages found."""

    described: Sequence[DescribedMap]
    hypotheses: PairHypotheses
    agreement: Agreement
    groups: tuple[PlacedGroup, ...]


def judge_pairs(findings: Findings, config: MergeConfig) -> tuple[PairResult, ...]:
    """Tell of every pair whether its motion is confirmed by the placement, contradicts it, or was not found."""
    tree = _tree_pairs(findings, config)
    where = {member: (group, k) for group in findings.groups for k, member in enumerate(group.members)}
    results = []
    for i, j in combinations(range(len(findings.described)), 2):
        confirmed = None
        if where[i][0] is where[j][0]:
            T = where[i][0].T_first_map
            T_i_j = se2.invert(T[where[i][1]]) @ T[where[j][1]]
            confirmed = _confirm((i, j), T_i_j, findings, config)
        results.append(_judge((i, j), confirmed, findings, config, (i, j) in tree))
    return tuple(results)


def _confirm(pair: tuple[int, int], T_i_j: Array, findings: Findings, config: MergeConfig) -> Hypothesis | None:
    """The motion of a pair that agrees with the placement, found before or now from the placement.

    None if the maps have too little in common under it: then the pair itself says nothing.
    """
    target, source = (findings.described[number].structure for number in pair)
    pairs, least_m = config.robust.consensus.pairs, config.robust.min_shared * min(target.length_m, source.length_m)
    near = replace(pairs, same_m=0.5 * pairs.same_m, same_deg=0.5 * pairs.same_deg)
    motions = findings.hypotheses[pair]
    found = confirmed_motion(motions, T_i_j, source, near)
    if found is None:
        glance = measure_evidence(target, source, T_i_j, pairs.verification, pairs.num_quick_points)
        if glance.near_m < least_m:
            return None
        T = align_walls(target, source, T_i_j, pairs.fine)
        proposed = [T, *(motion.T_target_source for motion in motions)]
        judged = judge_motions(target, source, distinct_motions(proposed, source, len(proposed), pairs), pairs)
        found = confirmed_motion(judged, T_i_j, source, near)
    return found if found is not None and 0.0 < found.evidence.near_m >= least_m else None


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
        confidence=probability(shown.log_odds) if confirmed is None else _relation_confidence(pair, findings),
        T_target_source_initial=shown.T_target_source if status is not PairStatus.NO_MATCH else None,
        information=motion_information(target, source, shown.T_target_source, config.robust.joint.metre_variance_m3),
        in_tree=in_tree and confirmed is not None,
    )


def _relation_confidence(pair: tuple[int, int], findings: Findings) -> float:
    """Probability that two placed maps lie right to each other: the joins that one of them hangs on, but not both."""
    confidence = 1.0
    for join in findings.agreement.joins:
        smaller = min((join.others, join.members), key=len)
        apart = {number in smaller for number in pair} == {True, False}
        confidence *= probability(join.log_odds) if apart else 1.0
    return confidence


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
    if evidence.near_m > 1.5 * evidence.expected_m:
        return f"{head}: {evidence.near_m:.1f} m of walls agree, but only {evidence.free_m2:.0f} m2 of floor are shared"
    if evidence.blunt_m < 0.1 * evidence.near_m:
        return f"{head}: hardly more than straight walls agree"
    return (
        f"{head}: {evidence.near_m:.1f} m of agreeing walls and {evidence.free_m2:.0f} m2 of shared floor are too few"
    )


def _joined(i: int, j: int, findings: Findings) -> bool:
    return any(i in group.members and j in group.members for group in findings.groups)


def _tree_pairs(findings: Findings, config: MergeConfig) -> set[tuple[int, int]]:
    """The pair with most agreeing wall between the two sides of each join, among the confirmed ones."""
    place = {m: (g, k) for g in findings.groups for k, m in enumerate(g.members)}
    tree, pairs = set(), config.robust.consensus.pairs
    for join in findings.agreement.joins:
        best: tuple[float, tuple[int, int]] | None = None
        for a in join.members:
            for b in join.others:
                i, j = min(a, b), max(a, b)
                group = place[i][0]
                T_i_j = se2.invert(group.T_first_map[place[i][1]]) @ group.T_first_map[place[j][1]]
                found = confirmed_motion(findings.hypotheses[(i, j)], T_i_j, findings.described[j].structure, pairs)
                if found is not None and (best is None or found.score_m > best[0]):
                    best = (found.score_m, (i, j))
        if best is not None:
            tree.add(best[1])
    return tree
