"""The settings of a whole merge: one config of each algorithm's file."""

from collections.abc import Callable
from dataclasses import dataclass, field

from merger.compositing import CompositingConfig
from merger.features import FeatureConfig
from merger.grid_map import resolution_fault
from merger.motion_averaging import MotionAveragingConfig
from merger.pairwise import PairwiseConfig
from merger.ransac import RansacConfig
from merger.result import Method
from merger.rival.motion_modes import MotionModesConfig
from merger.rival.shrinking_icp import ShrinkingIcpConfig
from merger.robust.config import RobustConfig
from merger.spanning_tree import SpanningTreeConfig
from merger.trimmed_icp import TrimmedIcpConfig

Progress = Callable[[str, int, int], None]
"""``progress(stage, done, total)`` is called as the work goes on."""


@dataclass(frozen=True)
class MergeConfig:
    """Settings of `merger.pipeline.merge_maps`; the defaults of the paper's parts are the paper's values.

    Raises:
        ValueError: a setting is out of its range.
    """

    method: Method = Method.ROBUST
    """How to merge."""
    seed: int = 0
    """Seed of every random stream, at least 0."""
    workers: int = 1
    """Threads or processes that work on maps and pairs, at least 1; the result does not depend on it."""
    reference: str | None = None
    """Name of the reference map; None: the first map."""
    resolution_m: float | None = None
    """Cell side of the merged map, in [0.001, 100]; None: the reference map's."""
    estimate_scale: bool = False
    """Whether maps' stated resolutions may be off by a few per cent, and are estimated (method `robust` only)."""
    composite: bool = True
    """Whether to make the merged map; without it `MergeResult.merged` is None."""
    features: FeatureConfig = field(default_factory=FeatureConfig)
    """Keypoints and their matches."""
    ransac: RansacConfig = field(default_factory=RansacConfig)
    """Motion guesses."""
    icp: TrimmedIcpConfig = field(default_factory=TrimmedIcpConfig)
    """TrICP."""
    tree: SpanningTreeConfig = field(default_factory=SpanningTreeConfig)
    """Sampling and confirming of spanning trees."""
    averaging: MotionAveragingConfig = field(default_factory=MotionAveragingConfig)
    """Motion averaging."""
    modes: MotionModesConfig = field(default_factory=MotionModesConfig)
    """Hypotheses of the method `sequential`."""
    shrinking_icp: ShrinkingIcpConfig = field(default_factory=ShrinkingIcpConfig)
    """Their refinement."""
    robust: RobustConfig = field(default_factory=RobustConfig)
    """The method `robust`."""
    compositing: CompositingConfig = field(default_factory=CompositingConfig)
    """The merged map."""

    @property
    def pairwise(self) -> PairwiseConfig:
        """The settings of Algorithm 1."""
        return PairwiseConfig(self.features, self.ransac, self.icp)

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if self.seed < 0:
            raise ValueError(f"seed must be >= 0, got {self.seed}")
        if self.workers < 1:
            raise ValueError(f"workers must be >= 1, got {self.workers}")
        if self.resolution_m is not None and (fault := resolution_fault(self.resolution_m)):
            raise ValueError(fault)
