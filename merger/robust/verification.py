"""What two maps say about a motion between them: walls that agree, walls that contradict free space, and how much.

Everything is measured in metres of wall, so that it means the same for any resolution, map size and scan density.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.robust import wall_kernels
from merger.robust.wall_alignment import field_motion
from merger.robust.wall_structure import WallStructure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VerificationConfig:
    """What counts as agreement and as conflict.

    Raises:
        ValueError: a setting is out of its range.
    """

    near_m: float = 0.15
    """A wall this near to one of the other map agrees with it, metres, > 0."""
    far_m: float = 0.3
    """A wall in the other map's free space, farther than this from its walls, conflicts, metres, >= ``near_m``."""
    tight_m: float = 0.05
    """Width of the kernel that measures how tightly walls agree, metres, > 0."""
    near_cells: float = 1.01
    """The same in cells of the map that is looked up, of which none tells places apart, > 0: the larger of both counts;
    twice as many for ``far_m``."""
    facing: float = 0.3
    """Product of the free sides below minus which two walls are opposite faces, in (0, 1)."""

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        for name in ("near_m", "near_cells", "tight_m"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, got {getattr(self, name)}")
        if not self.far_m >= self.near_m:
            raise ValueError(f"far_m must be >= near_m = {self.near_m}, got {self.far_m}")
        if not 0.0 < self.facing < 1.0:
            raise ValueError(f"facing must be in (0, 1), got {self.facing}")

    def reach_m(self, resolution_m: float) -> tuple[float, float]:
        """Near and far, metres, in a map of this resolution."""
        cell_m = self.near_cells * resolution_m
        return max(self.near_m, cell_m), max(self.far_m, 2.0 * cell_m)


@dataclass(frozen=True)
class Evidence:
    """What two maps say about one motion; lengths are means over both directions, metres of wall."""

    near_m: float
    """Walls that lie on walls of the other map, free on the same side."""
    opposed_m: float
    """Walls that lie on walls whose free side is the opposite one: the two faces of a wall."""
    conflict_m: float
    """Walls deep in the other map's free space."""
    loose_m: float
    """Walls between agreement and conflict in known space."""
    tight_m: float
    """Walls that agree, weighted by how tightly."""
    weak_m: float
    """Agreeing wall length that pins the worse known direction of the shift (0 in a bare corridor)."""
    strong_m: float
    """Agreeing wall length that pins the better known direction."""
    blunt_m: float
    """Agreeing walls that are no straight lines: corners, door frames, furniture."""
    free_m2: float
    """Area that is free in both maps."""
    expected_m: float
    """Wall that so much floor has in the two maps."""

    @property
    def agreement(self) -> float:
        """Share, 0..1, of the compared walls that do not conflict; 0 if nothing was compared."""
        compared = self.near_m + self.conflict_m
        return self.near_m / compared if compared > 0.0 else 0.0


def measure_evidence(
    target: WallStructure,
    source: WallStructure,
    T_target_source: Array,
    config: VerificationConfig,
    num_points: int | None = None,
) -> Evidence:
    """Compare two maps under a motion.

    Args:
        target: The map that stays.
        source: The map that moves.
        T_target_source: (3, 3) motion between the frames ``map``, metres.
        config: The settings.
        num_points: Compare about so many points of each map only, and no free area; None: all.

    Returns:
        The evidence; symmetric in the two maps.
    """
    T = field_motion(target, source, T_target_source)
    forward = _one_way(target, source, T, config, num_points)
    backward = _one_way(source, target, se2.invert(T), config, num_points)
    R = T[:2, :2]
    moment = R @ _matrix(forward[6:]) @ R.T + _matrix(backward[6:])
    weak, strong = np.linalg.eigvalsh(0.5 * moment)
    near, opposed, conflict, loose, tight, blunt = (float(value) for value in 0.5 * (forward[:6] + backward[:6]))
    num_free = wall_kernels.count_free(T, source.free_points, target.fields) if num_points is None else 0
    free_m2 = num_free * source.free_point_m2
    expected_m = free_m2 * math.sqrt(target.wall_per_floor * source.wall_per_floor)
    pinned = max(0.0, float(weak)), float(strong)
    return Evidence(near, opposed, conflict, loose, tight, *pinned, blunt, free_m2, expected_m)


def find_agreeing_walls(
    at: WallStructure, to: WallStructure, T_at_to: Array, config: VerificationConfig
) -> npt.NDArray[np.intp]:
    """Number the wall points of one map that agree with another: those of which `Evidence.near_m` is the length.

    Args:
        at: The map whose walls are asked for.
        to: The other map.
        T_at_to: (3, 3) motion of ``to`` into ``at``, frames ``map``, metres.
        config: The settings.

    Returns:
        (N,) rising numbers.
    """
    if len(to.walls.points) == 0:
        return np.zeros(0, dtype=np.intp)
    T_to_at = se2.invert(field_motion(at, to, T_at_to))
    near_m, _ = config.reach_m(to.fields.resolution_m)
    return wall_kernels.find_agreeing(T_to_at, at.walls, to.walls, to.fields, near_m, config.facing)


def _one_way(
    to: WallStructure, at: WallStructure, T_to_at: Array, config: VerificationConfig, num_points: int | None
) -> Array:
    """(9,) sums over one map's walls in the other (see `wall_kernels.compare_walls`)."""
    if len(to.walls.points) == 0:
        return np.zeros(wall_kernels.NUM_SUMS)
    walls, reach_m = at.sample(num_points), config.reach_m(to.fields.resolution_m)
    limits = (*reach_m, config.tight_m, config.facing)
    return np.asarray(wall_kernels.compare_walls(T_to_at, walls, to.walls, to.fields, *limits))


def _matrix(moments: Array) -> Array:
    """The symmetric (2, 2) matrix of xx, xy, yy."""
    return np.array([[moments[0], moments[1]], [moments[1], moments[2]]])
