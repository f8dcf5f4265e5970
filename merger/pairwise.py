"""One pair of maps: the paper's Algorithm 1."""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.features import FeatureConfig, match_features
from merger.nearest_edges import EdgeIndex
from merger.preparation import PreparedMap
from merger.ransac import RansacConfig, guess_motion
from merger.result import PairResult, PairStatus
from merger.trimmed_icp import TrimmedIcpConfig, TrimmedIcpResult, align


@dataclass(frozen=True)
class PairwiseConfig:
    """Settings of Algorithm 1."""

    features: FeatureConfig = field(default_factory=FeatureConfig)
    """Matches of keypoints."""
    ransac: RansacConfig = field(default_factory=RansacConfig)
    """Motion guesses, with the gate of four inliers."""
    icp: TrimmedIcpConfig = field(default_factory=TrimmedIcpConfig)
    """TrICP."""


def merge_pair(
    target: PreparedMap,
    source: PreparedMap,
    config: PairwiseConfig,
    rng: np.random.Generator,
) -> PairResult:
    """Estimate the relative motion of two maps: match keypoints, guess the motion, refine it by TrICP.

    Args:
        target: The map that stays.
        source: The map that moves.
        config: Settings.
        rng: The pair's own random stream.

    Returns:
        The motion between the maps' own metres, still to be confirmed (``reliable``), or the reason why there is none.
    """
    matches = match_features(target.features, source.features, config.features)
    places = target.features.points_grid[matches[:, 0]], source.features.points_grid[matches[:, 1]]
    guess = guess_motion(*places, config.ransac, rng)
    pair = PairResult(target.name, source.name, PairStatus.NO_MATCH)
    pair = replace(pair, num_matches=len(matches), num_inliers=guess.num_inliers)
    if target.edges is None or source.edges is None:
        return replace(pair, reason="a map has no wall to align")
    if guess.num_inliers < config.ransac.min_inliers:
        return replace(
            pair, reason=f"{guess.num_inliers} feature matches agree, {config.ransac.min_inliers} are needed"
        )
    refined = align_smaller(target.edges, source.edges, guess.T_target_source, config.icp)
    return replace(
        pair,
        status=PairStatus.RELIABLE,
        T_target_source=_to_map_frames(refined.T_target_source, target, source),
        T_target_source_initial=_to_map_frames(guess.T_target_source, target, source),
        overlap=refined.overlap,
        rmse_m=refined.rmse_m,
        information=se2.chain_information(refined.information, se2.invert(source.T_map_grid)),
    )


def align_smaller(
    target: EdgeIndex, source: EdgeIndex, T_target_source: npt.NDArray[np.float64], config: TrimmedIcpConfig
) -> TrimmedIcpResult:
    """Run TrICP so that the map with fewer edge points moves, and answer for the source.

    Note: The paper moves P. A large map in a small one has a tiny overlap, which is hard to estimate; the other
    way round it is large. Besides, the answer then does not depend on which of the two is called the target.
    """
    if len(source.points_grid) <= len(target.points_grid):
        return align(target, source.points_grid, T_target_source, config)
    inverse = align(source, target.points_grid, se2.invert(T_target_source), config)
    T_target_source = se2.invert(inverse.T_target_source)
    # inv(T exp(v)) = inv(T) exp(-Ad(T) v): as for a chain with inv(T), but for a sign that information does not see.
    information = se2.chain_information(inverse.information, T_target_source)
    return replace(inverse, T_target_source=T_target_source, information=information)


def _to_map_frames(
    T_gridt_grids: npt.NDArray[np.float64], target: PreparedMap, source: PreparedMap
) -> npt.NDArray[np.float64]:
    return np.asarray(target.T_map_grid @ T_gridt_grids @ se2.invert(source.T_map_grid))
