"""All maps laid onto each other at once: what moves which."""

from dataclasses import replace

import numpy as np
import pytest

from merger import se2
from merger.robust.joint_equations import JointEquationsConfig
from merger.robust.joint_refinement import JointRefinementConfig, refine_jointly
from merger.robust.wall_structure import WallStructureConfig, extract_structure


def test_a_bent_map_hardly_moves_the_others(cut_map):
    """The east of one map overlaps one that is right, its west another, and there its walls waver."""
    spans = ((0.0, 13.0), (9.0, 22.0), (0.0, 22.0))
    T = np.stack([se2.make_motion(2.0, 1.0, 0.0)] * 3)
    grids = [cut_map(str(k), span, T[k], resolution_m=0.05) for k, span in enumerate(spans)]
    cells = grids[2].log_odds.copy()
    for row in range(len(cells)):
        cells[row, :200] = np.roll(cells[row, :200], row // 4 % 4)  # by up to 0.15 m
    grids[2] = replace(grids[2], log_odds=cells)
    structures = [extract_structure(grid, WallStructureConfig()) for grid in grids]
    errors_m = []
    for equations in (JointEquationsConfig(closeness=0.0), JointEquationsConfig()):
        joint = refine_jointly(structures, T, JointRefinementConfig(equations))
        errors_m.append(np.hypot(*(joint.T_root_map[1] - T[1])[:2, 2]))
    assert errors_m[0] > 0.002
    assert errors_m[1] < 0.2 * errors_m[0]


def test_joint_refinement_does_not_depend_on_which_map_comes_first(cut_map, nudge):
    spans = ((0.0, 10.0), (5.0, 15.0), (8.0, 20.0))
    T_true = np.stack([se2.make_motion(2.0 * k, k, 0.7 * k) for k in range(3)])
    grids = [cut_map(str(k), spans[k], T_true[k], resolution_m=0.05) for k in range(3)]
    structures = [extract_structure(grid, WallStructureConfig()) for grid in grids]
    start = se2.invert(T_true[0]) @ T_true
    start[1] = nudge(start[1], structures[1].center_map, (0.05, 0.02, 0.005))
    forward = refine_jointly(structures, start, JointRefinementConfig()).T_root_map
    order = [2, 0, 1]
    turned = refine_jointly(
        [structures[k] for k in order], se2.invert(start[2]) @ start[order], JointRefinementConfig()
    ).T_root_map
    assert turned == pytest.approx((se2.invert(forward[2]) @ forward)[order], abs=1e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: JointEquationsConfig(closeness=-1.0), "closeness must be >= 0, got -1"),
        (lambda: JointEquationsConfig(num_points=5), "num_points must be >= 10, got 5"),
        (lambda: JointEquationsConfig(prior_m=0.0), "prior_m must be > 0, got 0"),
        (lambda: JointRefinementConfig(last_cutoff_m=0.0), "last_cutoff_m must be > 0, got 0"),
        (lambda: JointRefinementConfig(num_last_steps=-1), "num_last_steps must be >= 0, got -1"),
    ],
)
def test_settings_out_of_range_are_refused_with_name_and_value(make, words):
    with pytest.raises(ValueError, match=words):
        make()
