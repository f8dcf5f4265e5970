"""The settings of the robust method: one config of each of its files."""

from dataclasses import dataclass, field

from merger.consensus import ConsensusConfig
from merger.joint_refinement import JointRefinementConfig
from merger.robust_averaging import RobustAveragingConfig


@dataclass(frozen=True)
class RobustConfig:
    """Settings of `merger.robust.merge_robustly`."""

    consensus: ConsensusConfig = field(default_factory=ConsensusConfig)
    """What is found, how it is judged, and what is joined."""
    averaging: RobustAveragingConfig = field(default_factory=RobustAveragingConfig)
    """Averaging of relative motions."""
    joint: JointRefinementConfig = field(default_factory=JointRefinementConfig)
    """Refinement of all maps at once."""
    average: bool = True
    """Whether to average relative motions (off: an ablation)."""
    refine_jointly: bool = True
    """Whether to refine all maps at once (off: an ablation)."""
