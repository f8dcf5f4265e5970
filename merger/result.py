"""What a merge answers: the records, without the files (see `result_json`)."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from merger.grid_map import GridMap


class Method(StrEnum):
    """The ways to merge maps."""

    PAPER = "paper"
    ROBUST = "robust"
    SEQUENTIAL = "sequential"


class PairStatus(StrEnum):
    """What became of a pair of maps."""

    RELIABLE = "reliable"
    """A relative motion was found, and the other motions confirm it."""
    REJECTED = "rejected"
    """A relative motion was found, and the other motions contradict it."""
    NO_MATCH = "no_match"
    """No relative motion was found."""


@dataclass(frozen=True)
class PairResult:
    """One pair of maps; ``target`` comes before ``source`` in the order of names.

    In the method `sequential` a pair is a step, and its target is the first map, in whose frame the merged map lies.
    """

    target: str
    """Name of the map that stays."""
    source: str
    """Name of the map that moves."""
    status: PairStatus
    reason: str | None = None
    """Why the pair is not reliable, in words; None if it is."""
    T_target_source: npt.NDArray[np.float64] | None = None
    """(3, 3) refined motion of the source's frame ``map`` into the target's, metres; None without a match."""
    num_matches: int | None = None
    """Feature matches of both directions."""
    num_inliers: int | None = None
    """Feature matches that the best guess explains."""
    overlap: float | None = None
    """TrICP's xi: the share, 0..1, of the edge points of the map with fewer of them."""
    rmse_m: float | None = None
    """Root mean square distance of TrICP's trimmed correspondences."""
    agreement: float | None = None
    """Share, 0..1, of the compared edge points that do not fall into the other map's free space, if it was checked."""
    T_target_source_initial: npt.NDArray[np.float64] | None = None
    """(3, 3) motion before TrICP, from feature matches or a dense search."""
    information: npt.NDArray[np.float64] | None = None
    """(3, 3) information of ``v = (x, y, theta)`` in ``T_target_source @ exp(v)``: 1/m^2, 1/(m rad), 1/rad^2."""
    confidence: float | None = None
    """Probability, 0..1, that the motion is right; None if the method does not estimate it."""
    in_tree: bool = False
    """Whether the coarse motions were chained through this pair."""


@dataclass(frozen=True)
class MapPlacement:
    """Where a map lies."""

    name: str
    placed: bool
    """Whether it was joined to at least one other map."""
    component: int
    """Index into `MergeResult.components`."""
    T_ref_map: npt.NDArray[np.float64] | None = None
    """(3, 3) fine motion of the map's frame ``map`` into that of its component's reference; None if not placed."""
    T_ref_map_initial: npt.NDArray[np.float64] | None = None
    """(3, 3) coarse motion, chained along the tree."""
    confidence: float | None = None
    """Probability, 0..1, that the placement is right; None if the method does not estimate it."""
    covariance: npt.NDArray[np.float64] | None = None
    """(3, 3) covariance of ``v = (x, y, theta)`` in ``T_ref_map @ exp(v)``; None if not estimated."""
    reason: str | None = None
    """Why the map was left out; None if it is placed."""
    scale: float | None = None
    """Factor by which the map's metres must be multiplied before ``T_ref_map``; None if it was not estimated."""


@dataclass(frozen=True)
class Runtime:
    """Wall time by stage, seconds."""

    features: float = 0.0
    pairs: float = 0.0
    tree: float = 0.0
    averaging: float = 0.0
    compositing: float = 0.0
    total: float = 0.0


@dataclass(frozen=True)
class Objective:
    """How well the global motions explain the reliable relative ones, over all components.

    A residual is ``log(inv(T_i_j) @ inv(T_i) @ T_j)``, seen in the middle of map j; all are 0 without a cycle.
    """

    residual_initial_m: float | None = None
    """Root mean square translation of the residuals under the coarse motions; None if there is no motion."""
    residual_m: float | None = None
    """The same under the fine motions."""
    residual_initial_rad: float | None = None
    """Root mean square rotation of the residuals under the coarse motions."""
    residual_rad: float | None = None
    """The same under the fine motions."""
    num_trees: int = 0
    """Spanning trees that were drawn."""
    num_reliable: int = 0
    """Relative motions that were confirmed."""


@dataclass(frozen=True)
class MergeResult:
    """The answer of one merge."""

    method: Method
    seed: int
    version: str
    """Version of the package that made it."""
    reference: str
    """Name of the reference map."""
    maps: tuple[MapPlacement, ...]
    """One per map, in the order of names."""
    components: tuple[tuple[str, ...], ...]
    """Largest first, then by first name; names sorted. A component's frame is ``reference``'s, else its first map's."""
    pairs: tuple[PairResult, ...]
    """Every unordered pair, in the order of names."""
    objective: Objective = field(default_factory=Objective)
    runtime_s: Runtime = field(default_factory=Runtime)
    merged: GridMap | None = None
    """The largest component in one grid, in its reference's frame ``map``; None if it was not asked for."""

    @property
    def num_placed(self) -> int:
        """Maps that were joined to at least one other."""
        return sum(placement.placed for placement in self.maps)

    def placement(self, name: str) -> MapPlacement:
        """The placement of one map.

        Raises:
            KeyError: no map has this name.
        """
        for placement in self.maps:
            if placement.name == name:
                return placement
        raise KeyError(name)
