"""The truth: alignment of poses, overlap of maps, and its file."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merger import se2
from merger.grid_map import GridMap
from sim.maps.truth import (
    Truth,
    TruthError,
    align_poses,
    from_json_dict,
    overlap_fractions,
    read_truth,
    to_json_dict,
    write_truth,
)

coordinate = st.floats(-50.0, 50.0)
motion = st.builds(se2.make_motion, coordinate, coordinate, st.floats(-3.1, 3.1))


def walk(seed: int, count: int = 30) -> np.ndarray:
    rng = np.random.default_rng(seed)
    steps = se2.exp(rng.normal(0.3, 0.2, (count, 3)))
    poses = [np.eye(3)]
    for step in steps:
        poses.append(poses[-1] @ step)
    return np.stack(poses)


@given(motion, st.integers(0, 50))
def test_undistorted_poses_give_the_exact_motion_and_no_distortion(T_world_map, seed):
    poses = walk(seed)
    T, rms = align_poses(T_world_map @ poses, poses)
    assert np.allclose(T, T_world_map, atol=1e-9)
    assert rms < 1e-9


@given(motion, st.integers(0, 50))
def test_moving_the_submaps_frame_moves_the_answer_by_just_that_and_keeps_the_distortion(T_a_b, seed):
    world, estimated = walk(seed), walk(seed) @ se2.exp(np.random.default_rng(seed).normal(0, 0.1, (31, 3)))
    T, rms = align_poses(world, estimated)
    T_moved, rms_moved = align_poses(world, T_a_b @ estimated)
    assert np.allclose(T_moved @ T_a_b, T, atol=1e-8)
    assert rms_moved == pytest.approx(rms, abs=1e-9)


def test_no_other_motion_has_a_smaller_residual():
    rng = np.random.default_rng(1)
    world, estimated = walk(3), walk(3) @ se2.exp(rng.normal(0, 0.2, (31, 3)))
    T, rms = align_poses(world, estimated)
    for _ in range(200):
        other = T @ se2.exp(rng.normal(0, 0.02, 3))
        residual = se2.transform_points(other, estimated[:, :2, 2]) - world[:, :2, 2]
        assert np.sqrt(np.mean(np.sum(residual**2, axis=1))) >= rms


def test_a_robot_that_stands_still_is_aligned_by_its_headings():
    T_world_map = se2.make_motion(3.0, -2.0, 2.5)
    poses = se2.make_motion(np.full(5, 1.0), np.full(5, 1.0), np.linspace(0, 2, 5))
    T, rms = align_poses(T_world_map @ poses, poses)
    assert np.allclose(T, T_world_map)
    assert rms < 1e-12


def wall(name: str, first: int, last: int, row: int = 5) -> GridMap:
    cells = np.zeros((20, 40), dtype=np.float32)
    cells[row, first:last] = 2.0
    return GridMap(name, cells, 0.05)


def test_overlap_is_the_share_of_is_walls_that_lie_within_two_cells_of_js():
    long, half, near, far = wall("a", 0, 40), wall("b", 0, 20), wall("c", 0, 40, row=7), wall("d", 0, 40, row=8)
    fraction = overlap_fractions([long, half, near, far], np.stack([np.eye(3)] * 4))
    assert fraction[0, 1] == pytest.approx(22 / 40)
    assert fraction[1, 0] == 1.0
    assert fraction[0, 2] == 1.0
    assert fraction[0, 3] == 0.0
    assert np.diag(fraction).tolist() == [1.0] * 4


@given(motion)
def test_overlap_is_measured_under_the_true_motions(T):
    fraction = overlap_fractions([wall("a", 0, 40), wall("b", 0, 20)], np.stack([T, T]))
    assert fraction[1, 0] == 1.0
    moved = overlap_fractions([wall("a", 0, 40), wall("b", 0, 20)], np.stack([T, T @ se2.make_motion(0.0, 1.0, 0.0)]))
    assert moved[1, 0] == 0.0


def test_a_map_without_walls_overlaps_nothing():
    empty = GridMap("e", np.zeros((3, 3), dtype=np.float32), 0.05)
    assert overlap_fractions([empty, wall("a", 0, 40)], np.stack([np.eye(3)] * 2)).tolist() == [[0, 0], [0, 1]]


def some_truth() -> Truth:
    T = se2.make_motion([1.0, 2.0], [0.5, -0.25], [3.0, -1.0])
    overlap = np.array([[1.0, 0.25], [0.5, 1.0]])
    return Truth(("a", "b"), T, np.array([0.0, 0.1]), ("robot_0",) * 2, np.zeros(2), np.ones(2), overlap)


def test_the_file_gives_the_truth_back(tmp_path):
    write_truth(tmp_path / "truth.json", some_truth())
    back = read_truth(tmp_path / "truth.json")
    assert np.allclose(back.T_world_map, some_truth().T_world_map, atol=1e-15)
    assert to_json_dict(back) == to_json_dict(some_truth())


@pytest.mark.parametrize(
    "path", [("schema",), ("maps",), ("maps", "a"), ("maps", "b", "T_world_map", "theta"), ("overlap", "names")]
)
def test_a_document_without_a_field_is_refused(path):
    document = json.loads(json.dumps(to_json_dict(some_truth())))
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    with pytest.raises(TruthError):
        from_json_dict(document)


def test_a_missing_or_broken_file_is_refused_by_name(tmp_path):
    with pytest.raises(TruthError, match=r"truth.json: cannot be read"):
        read_truth(tmp_path / "truth.json")
    (tmp_path / "truth.json").write_text("{")
    with pytest.raises(TruthError, match=r"truth.json: cannot be read"):
        read_truth(tmp_path / "truth.json")
