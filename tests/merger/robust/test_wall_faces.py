"""The faces of walls: which wall points are left, and what their fields answer."""

import numpy as np
import pytest

from merger.grid_map import GridMap
from merger.robust.joint_refinement import JointRefinementConfig, refine_jointly
from merger.robust.wall_faces import extract_faces
from merger.robust.wall_structure import WallStructureConfig, extract_structure

_CELL_M = 0.05


def room(behind: tuple[int, int]) -> GridMap:
    """A room of 6 m by 5 m, seen from inside; its west and its east wall reach so many cells beyond their faces."""
    cells = np.zeros((120, 150), dtype=np.float32)
    cells[10:110, 10 - behind[0] : 130 + behind[1]] = 2.0
    cells[11:109, 11:129] = -2.0
    return GridMap("room", cells, _CELL_M)


@pytest.mark.parametrize("behind", [(2, 0), (0, 3), (4, 1)])
def test_what_lies_behind_a_face_does_not_change_the_faces(behind):
    thin, thick = (extract_structure(room(item), WallStructureConfig()) for item in ((0, 0), behind))
    assert len(thick.walls.points) > len(thin.walls.points)
    bare, faces = (extract_faces(item).walls.points + item.T_map_field[:2, 2] for item in (thin, thick))
    assert faces[np.lexsort(faces.T)] == pytest.approx(bare[np.lexsort(bare.T)])


def test_walls_whose_backs_are_noise_are_laid_face_onto_face():
    """Laid onto each other as they are, backs and holes hold the second map where it started."""
    structures = []
    for seed in range(2):
        rng, grid = np.random.default_rng(seed), room((9, 9))
        behind = grid.log_odds > 0.0
        behind[9:111, 9:131] = False
        cells = np.where(behind & (rng.random(behind.shape) < 0.5), 0.0, grid.log_odds).astype(np.float32)
        structures.append(extract_structure(GridMap(str(seed), cells, _CELL_M), WallStructureConfig()))
    start = np.stack([np.eye(3)] * 2)
    start[1, 0, 2] = 0.04
    refined = refine_jointly(structures, start, JointRefinementConfig()).T_root_map
    assert refined[1] == pytest.approx(np.eye(3), abs=2e-3)


@pytest.mark.parametrize("spacing_m", [0.05, 0.1])
def test_fields_name_the_nearest_face_and_how_far_it_is(spacing_m):
    faces = extract_faces(extract_structure(room((3, 2)), WallStructureConfig(spacing_m=spacing_m)))
    rows, cols = np.indices(faces.fields.state.shape)
    centers = (np.stack([cols, rows], axis=-1) + 0.5) * _CELL_M
    inner = np.isfinite(faces.fields.distance_m)
    apart = np.linalg.norm(centers[inner] - faces.walls.points[faces.fields.nearest[inner]], axis=1)
    # A point lies within half its square's diagonal of its cells; the transform errs by 5 % at most.
    slack = np.hypot(spacing_m, spacing_m) / 2.0
    assert np.abs(apart - faces.fields.distance_m[inner]).max() < slack + 0.05 * apart.max()
    nearest = np.array([np.linalg.norm(faces.walls.points - point, axis=1).min() for point in centers[inner][::97]])
    assert apart[::97] == pytest.approx(nearest, abs=2.0 * slack + 0.05 * apart.max())
    assert not np.isfinite(faces.fields.distance_m[0]).any()


def test_a_map_without_free_space_keeps_all_its_walls():
    grid = room((1, 1))
    structure = extract_structure(GridMap("w", np.maximum(grid.log_odds, 0.0), _CELL_M), WallStructureConfig())
    assert extract_faces(structure) is structure
