"""A motion in question from the paper's features: what most matches of two maps' keypoints agree on (Sec. 3.1)."""

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.features import FeatureConfig, match_features
from merger.preparation import PreparedMap
from merger.ransac import RansacConfig, guess_motion


def propose_motion(
    target: PreparedMap, source: PreparedMap, features: FeatureConfig, ransac: RansacConfig, rng: np.random.Generator
) -> npt.NDArray[np.float64] | None:
    """Guess the motion of two maps from their keypoints.

    Args:
        target: The map that stays.
        source: The map that moves.
        features: How keypoints are matched.
        ransac: How motions are guessed; its gate does not apply, since the motion is judged by the maps.
        rng: The pair's own random stream.

    Returns:
        (3, 3) ``T_target_source`` between the frames ``map``, metres; None if no two matches agree.
    """
    matches = match_features(target.features, source.features, features)
    places = target.features.points_grid[matches[:, 0]], source.features.points_grid[matches[:, 1]]
    guess = guess_motion(*places, ransac, rng)
    if guess.num_inliers < 2:
        return None
    return np.asarray(target.T_map_grid @ guess.T_target_source @ se2.invert(source.T_map_grid))
