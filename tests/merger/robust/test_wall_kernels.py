"""The loops over walls, each beside a slow way to do the same."""

import subprocess
import sys

import numpy as np
import pytest

from merger import se2
from merger.robust import wall_kernels
from merger.robust.alignment_kernel import sum_equations, sum_equations_onto, sum_gaps_onto
from merger.robust.verification import VerificationConfig
from merger.robust.wall_alignment import AlignmentConfig, align_all, align_walls
from merger.robust.wall_kernels import View, Walls


def test_compare_walls_agrees_with_a_slow_oracle(pair, T_A_B):
    target, source = pair
    T = se2.invert(target.T_map_field) @ T_A_B @ source.T_map_field
    limits = VerificationConfig()
    sums = wall_kernels.compare_walls(
        T, source.walls, target.walls, target.fields, limits.near_m, limits.far_m, limits.tight_m, limits.facing
    )
    near = opposed = conflict = blunt = 0.0
    walls = source.walls
    for point, facing, length, line in zip(walls.points, walls.facing, walls.lengths_m, walls.linearity, strict=True):
        place = se2.transform_points(T, point[None])[0]
        col, row = np.floor(place / target.fields.resolution_m).astype(int)
        rows, cols = target.fields.state.shape
        if not (0 <= row < rows and 0 <= col < cols):
            continue
        distance = target.fields.distance_m[row, col]
        other = target.walls.facing[target.fields.nearest[row, col]]
        against = (T[:2, :2] @ facing) @ other < -limits.facing
        near += length * (distance <= limits.near_m and not against)
        blunt += length * (1.0 - line) * (distance <= limits.near_m and not against)
        opposed += length * (distance <= limits.near_m and against)
        conflict += length * (distance > limits.far_m and target.fields.state[row, col] == wall_kernels.FREE)
    # A point may lie on a cell's border.
    assert sums[[0, 1, 2, 5]] == pytest.approx([near, opposed, conflict, blunt], rel=2e-3)


def test_several_motions_are_scored_as_each_by_itself(pair, T_A_B, nudge):
    target, source = pair
    T = np.stack([nudge(T_A_B, source.center_map, (0.5 * k, 0.1, 0.05 * k)) for k in range(4)])
    T = target.T_field_map @ T @ source.T_map_field
    views = (source.walls, target.walls, target.fields)
    near, conflict = wall_kernels.score_walls(T, *views, 0.15, 0.3, 0.3)
    each = np.array([wall_kernels.compare_walls(one, *views, 0.15, 0.3, 0.05, 0.3) for one in T])
    assert near == pytest.approx(each[:, 0])
    assert conflict == pytest.approx(each[:, 2])


def test_several_motions_are_refined_as_each_by_itself(pair, T_A_B, nudge):
    starts = [nudge(T_A_B, pair[1].center_map, (0.2 * k, 0.1, 0.02 * k)) for k in range(4)]
    config = AlignmentConfig(cutoffs_m=(0.5, 0.3, 0.2, 0.2, 0.2, 0.2), tolerance=1e-3)
    together = align_all(*pair, starts, config)
    for T, start in zip(together, starts, strict=True):
        assert pytest.approx(align_walls(*pair, start, config), abs=1e-9) == T


def test_equations_agree_with_the_slopes_of_their_residuals(pair, T_A_B, nudge):
    target, source = (item.view(300) for item in pair)
    T = pair[0].T_field_map @ nudge(T_A_B, pair[1].center_map, (0.05, -0.03, 0.005)) @ pair[1].T_map_field
    A, b = sum_equations(T[None], target, source, 0.4)
    residuals, weights, slopes = slow_residuals(T, target, source, 0.4)
    assert A[0] == pytest.approx(slopes.T @ (weights[:, None] * slopes), rel=1e-4, abs=1e-6 * A.max())
    assert b[0] == pytest.approx(-slopes.T @ (weights * residuals), rel=1e-4, abs=1e-6 * A.max())


def test_maps_are_laid_onto_another_together_as_each_by_itself(pair, T_A_B, nudge):
    target, source = pair
    T = np.stack([nudge(T_A_B, source.center_map, (0.02 * k, 0.01, 0.002 * k)) for k in range(3)])
    T = target.T_field_map @ T @ source.T_map_field
    walls, cutoffs_m = [source.sample(200), source.sample(400), source.walls], np.array([0.1, 0.2, 0.3])
    A, b = sum_equations_onto(T, walls, target.view(None), cutoffs_m)
    squares, weights = sum_gaps_onto(T, walls, target.view(None), cutoffs_m)
    nothing = Walls(np.zeros((0, 8)))
    for k, cutoff_m in enumerate(cutoffs_m):
        alone = sum_equations(
            T[k : k + 1],
            View(nothing, target.walls, target.fields),
            View(walls[k], source.walls, source.fields),
            cutoff_m,
        )
        assert A[k] == pytest.approx(alone[0][0])
        assert b[k] == pytest.approx(alone[1][0])
        assert 0.0 < squares[k] < cutoff_m**2 * weights[k]
    assert weights[2] == pytest.approx(sum_gaps_onto(T[2:], walls[2:], target.view(None), cutoffs_m[2:])[1][0])


def slow_residuals(
    T: np.ndarray, target: View, source: View, cutoff_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residuals of both directions, their weights, and their slopes over ``v`` in ``exp(v) @ T`` by differences."""
    rows = []
    for of, to, forward in ((source, target, True), (target, source, False)):
        motion = T if forward else se2.invert(T)
        for k, point in enumerate(of.sample.points):
            col, row = np.floor(se2.transform_points(motion, point[None])[0] / to.fields.resolution_m).astype(int)
            high, wide = to.fields.state.shape
            if not (0 <= row < high and 0 <= col < wide) or to.fields.distance_m[row, col] >= cutoff_m:
                continue
            n = to.fields.nearest[row, col]
            apart = se2.transform_points(motion, point[None])[0] - to.walls.points[n]
            u = float(apart @ apart) / cutoff_m**2
            R = motion[:2, :2]
            if u >= 1.0 or (R @ of.sample.facing[k]) @ to.walls.facing[n] < -0.3:
                continue
            line = of.sample.linearity[k] * to.walls.linearity[n]
            same = abs((R @ of.sample.normals[k]) @ to.walls.normals[n])
            weight = of.sample.lengths_m[k] * (1.0 - u) ** 2 * (1.0 - line * (1.0 - same))
            ends = (point, to.walls.points[n]) if forward else (to.walls.points[n], point)
            normal = to.walls.normals[n] if forward else T[:2, :2] @ to.walls.normals[n]
            for direction, share in ((normal, 1.0), (np.array([-normal[1], normal[0]]), 1.0 - 0.9 * line)):
                rows.append((*slope_of(T, *ends, direction), weight * share))
    table = np.array(rows)
    return table[:, 0], table[:, 4], table[:, 1:4]


def slope_of(T: np.ndarray, moved: np.ndarray, fixed: np.ndarray, direction: np.ndarray) -> tuple[float, ...]:
    """A residual at ``v = 0``, and its three slopes."""
    values = []
    for v in np.vstack([np.zeros(3), 1e-6 * np.eye(3), -1e-6 * np.eye(3)]):
        values.append(direction @ (se2.transform_points(se2.exp(v) @ T, moved[None])[0] - fixed))
    return (values[0], *((up - down) / 2e-6 for up, down in zip(values[1:4], values[4:], strict=True)))


def test_the_robust_method_starts_without_compiler_and_scipy():
    code = "import sys, merger.pipeline; sys.exit(any(name in sys.modules for name in ('numba', 'scipy')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
