"""What a method answered, as the bench scores it: each map's place, each pair's motion, in arrays."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class PredictedPair:
    """What a method says about two maps; ``target`` stays, ``source`` moves."""

    target: int
    """Index of the map that stays."""
    source: int
    """Index of the map that moves."""
    status: str
    """``reliable``, ``rejected`` or ``no_match``."""
    reason: str | None
    """Why it is not reliable."""
    T_target_source: npt.NDArray[np.float64] | None
    """(3, 3) motion between the maps' frames, or none."""
    num_matches: float
    """Feature matches; NaN where not said."""
    num_inliers: float
    """Matches that the motion explains; NaN where not said."""
    agreement: float
    """Share of compared edge points that agree; NaN where not said."""
    T_target_source_initial: npt.NDArray[np.float64] | None = None
    """(3, 3) motion before it was refined, where the method says so."""
    in_tree: bool = False
    """Whether the spanning tree uses it, where the method says so."""


@dataclass(frozen=True)
class Prediction:
    """A method's answer for N maps, in the order of the dataset's truth."""

    names: tuple[str, ...]
    """Names of the maps."""
    placed: npt.NDArray[np.bool_]
    """(N,) whether the map is placed."""
    component: npt.NDArray[np.int64]
    """(N,) number of the map's component."""
    T_ref_map: npt.NDArray[np.float64]
    """(N, 3, 3) fine motions into the component's reference; NaN where not placed."""
    T_ref_map_initial: npt.NDArray[np.float64]
    """(N, 3, 3) coarse motions; NaN where not given."""
    confidence: npt.NDArray[np.float64]
    """(N,) stated probability of being right; NaN where not given."""
    reasons: tuple[str | None, ...]
    """Why each map is not placed."""
    pairs: tuple[PredictedPair, ...]
    """What is said about pairs; empty where the method says nothing."""
    stages_s: dict[str, float]
    """Seconds by stage, as the method states them."""
