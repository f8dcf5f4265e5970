"""The settings of the robust method: one config of each of its files."""

from dataclasses import dataclass, field

from merger.robust.averaging import RobustAveragingConfig
from merger.robust.consensus import ConsensusConfig
from merger.robust.joint_refinement import JointRefinementConfig


@dataclass(frozen=True)
class RobustConfig:
    """Settings of `merger.robust.pipeline.merge_robustly`.

    Raises:
        ValueError: a setting is out of its range.
    """

    consensus: ConsensusConfig = field(default_factory=ConsensusConfig)
    """What is found, how it is judged, and what is joined."""
    averaging: RobustAveragingConfig = field(default_factory=RobustAveragingConfig)
    """Averaging of relative motions."""
    joint: JointRefinementConfig = field(default_factory=JointRefinementConfig)
    """Refinement of all maps at once."""
    features: bool = False
    """Whether the paper's features propose motions, too: of 93 pairs of real maps that the dense search missed they
    found 4, at a third more time."""
    average: bool = True
    """Whether to average relative motions (off: an ablation)."""
    refine_jointly: bool = True
    """Whether to refine all maps at once (off: an ablation)."""
    min_shared: float = 0.05
    """Share of the smaller map's walls that two placed maps have in common if their pair is reliable, in [0, 1]."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not 0.0 <= self.min_shared <= 1.0:
            raise ValueError(f"min_shared must be in [0, 1], got {self.min_shared}")
