"""The methods that come as examples: what they need is optional, what they know is tested without it."""

import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from bench.mergers.external import SKIP_STATUS, call_command
from bench.mergers.fork_server import Skipped
from bench.mergers.shipped import SHIPPED, shipped_command
from bench.mergers.submap_scans import write_submap_scans
from merger import se2
from merger.grid_map import GridMap
from merger.map_server import read_map, write_map

EXAMPLES = Path(__file__).parents[3] / "bench" / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def has_open3d():
    return importlib.util.find_spec("open3d") is not None


def has_mrpt():
    return shutil.which("grid-matching") is not None and shutil.which("carmen2simplemap") is not None


def motion_of(entry):
    return se2.make_motion(*(entry["T_ref_map"][key] for key in ("x", "y", "theta")))


def answer_of(name, maps, work):
    """What a shipped method writes for the maps of a folder."""
    (work / "out").mkdir(parents=True)
    call_command(shipped_command(name), sorted(maps.glob("*.yaml")), work)
    return json.loads((work / "out" / "result.json").read_text())


def picture(rng):
    """Walls that are nowhere the same, as a map that corner detectors like."""
    cells = np.full((400, 400), -2.0, dtype=np.float32)
    for row, col, height, width in rng.integers(5, 360, (60, 4)):
        cells[row : row + height % 40 + 3, col : col + width % 40 + 3] = rng.choice([2.0, -2.0, 0.0])
    return cells


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_method_is_a_program_that_a_command_calls(name):
    command = shipped_command(name)
    assert "{maps}" in command
    assert "{out}" in command
    assert Path(command.split()[1]).is_file()


@pytest.mark.parametrize("name", ["open3d", "mrpt"])
def test_a_method_that_is_not_installed_is_skipped_and_says_what_to_install(name, dataset, tmp_path):
    if {"open3d": has_open3d, "mrpt": has_mrpt}[name]():
        pytest.skip("it is installed")
    with pytest.raises(Skipped, match="not installed"):
        answer_of(name, dataset.path / "maps", tmp_path)


def test_the_status_for_skipping_is_the_same_everywhere():
    statuses = [load(path.stem).SKIPPED for path in EXAMPLES.glob("*.py") if path.stem != "__init__"]
    assert statuses == [SKIP_STATUS] * 3


@pytest.mark.skipif(not hasattr(cv2, "Stitcher_create"), reason="this OpenCV comes without Stitcher")
def test_the_stitcher_finds_the_motion_between_two_parts_of_one_map(tmp_path):
    cells = picture(np.random.default_rng(1))
    T_world = [se2.make_motion(3.0, -2.0, 0.4), se2.make_motion(-5.0, 1.0, -2.0)]
    (tmp_path / "maps").mkdir()
    for k, (columns, T) in enumerate(zip([slice(0, 280), slice(120, 400)], T_world, strict=True)):
        corner = se2.make_motion(columns.start * 0.05, 0.0, 0.0)
        write_map(tmp_path / "maps" / f"m{k}.yaml", GridMap(f"m{k}", cells[:, columns].copy(), 0.05, T @ corner))
    maps = answer_of("stitcher", tmp_path / "maps", tmp_path / "work")["maps"]
    motions = [motion_of(maps[name]) for name in ("m0", "m1")]
    found = se2.invert(motions[0]) @ motions[1]
    np.testing.assert_allclose(found, T_world[0] @ se2.invert(T_world[1]), atol=0.03)


def test_open3d_gets_wall_points_in_metres_and_normals_towards_free_space(tmp_path):
    cells = np.zeros((40, 60), dtype=np.float32)
    cells[10, 5:55], cells[11:35, 5:55] = 2.0, -2.0
    T = se2.make_motion(7.0, -3.0, 0.9)
    write_map(tmp_path / "m.yaml", GridMap("m", cells, 0.1, T))
    points, normals = load("open3d_multiway").read_cloud(tmp_path / "m.yaml")
    grid = read_map(tmp_path / "m.yaml")
    np.testing.assert_allclose(np.sort(points, axis=0), np.sort(grid.cell_centers(grid.occupied), axis=0), atol=1e-9)
    np.testing.assert_allclose(normals[10:-10], np.broadcast_to(T[:2, 1], normals[10:-10].shape), atol=1e-9)


def test_open3d_chains_the_fittest_edges_and_numbers_components_by_their_first_map():
    def flat(x):
        T = np.eye(4)
        T[0, 3] = x
        return T

    edges = [(0, 2, 0.9, flat(1.0), None), (2, 3, 0.8, flat(2.0), None), (0, 3, 0.1, flat(99.0), None)]
    component, T_ref_map = load("open3d_multiway").chain(4, edges)
    assert component == [0, 1, 0, 0]
    assert [T[0, 3] for T in T_ref_map] == [0.0, 0.0, 1.0, 3.0]


@pytest.mark.skipif(not has_open3d(), reason="Open3D is not installed")
def test_open3d_places_the_maps_of_a_small_building(dataset, tmp_path):
    assert answer_of("open3d", dataset.path / "maps", tmp_path)["schema"] == 1


def test_mrpt_moves_all_poses_of_a_log_and_nothing_else():
    mrpt = load("mrpt_grid_matching")
    quarter = mrpt.Motion(complex(1.0, 2.0), 1j)
    scan = mrpt.move_line("FLASER 2 5.0 6.0 1 0 0 1 0 0 7.5 robot 7.5", quarter).split()
    pose = ["1.000000000", "3.000000000", "1.570796327"]
    assert scan == ["FLASER", "2", "5.0", "6.0", *pose, *pose, "7.5", "robot", "7.5"]
    assert mrpt.move_line("ODOM 1 0 0 0 0 0 7.5 robot 7.5", quarter).split()[1:4] == pose
    assert mrpt.move_line("PARAM laser_front_laser_resolution 1 nohost 0", quarter) == ""


def test_mrpt_in_order_leaves_out_what_it_cannot_match_and_chains_pairs_by_agreement(monkeypatch, tmp_path):
    mrpt = load("mrpt_grid_matching")
    logs = {name: [f"ODOM {k} 0 0 0 0 0 {k} robot {k}"] for k, name in enumerate("abc")}
    monkeypatch.setattr(mrpt, "convert", lambda lines, stem: stem)
    answers = {"a": (0.9, mrpt.Motion(1 + 0j)), "b": None, "c": (0.8, mrpt.Motion(5 + 0j))}
    monkeypatch.setattr(mrpt, "match", lambda target, source, work: answers[source.name])
    components, pairs = mrpt.merge_in_order(logs, tmp_path)
    assert [sorted(c) for c in components] == [["a", "c"], ["b"]]
    assert pairs == []
    components, pairs = mrpt.merge_by_pairs(logs, tmp_path)
    assert [(i, j) for i, j, _, _ in pairs] == [("a", "c"), ("b", "c")]
    assert len(components) == 1
    mrpt.write_result(tmp_path, components, pairs)
    assert len(json.loads((tmp_path / "result.json").read_text())["pairs"]) == 2


def test_mrpt_runs_with_its_example_settings_but_draws_no_pictures(monkeypatch, tmp_path):
    mrpt = load("mrpt_grid_matching")
    example = tmp_path / mrpt.EXAMPLE
    example.parent.mkdir(parents=True)
    monkeypatch.setattr(mrpt.shutil, "which", lambda program: str(tmp_path / "bin" / program))
    mrpt.write_settings(tmp_path)
    assert not (tmp_path / "settings.ini").exists()
    example.write_text("[grid-match]\nmin_ICP_goodness = 0.30\ndebug_save_map_pairs\t= 1\n")
    mrpt.write_settings(tmp_path)
    assert (tmp_path / "settings.ini").read_text() == "[grid-match]\nmin_ICP_goodness = 0.30\n"


@pytest.mark.skipif(not has_mrpt(), reason="mrpt-apps is not installed")
def test_mrpt_answers_for_every_map(dataset, tmp_path):
    assert len(answer_of("mrpt", dataset.path / "maps", tmp_path)["maps"]) == len(dataset.maps)


def test_the_scans_of_a_submap_end_on_the_walls_of_its_map(dataset, tmp_path):
    write_submap_scans(dataset.path, tmp_path)
    assert sorted(path.stem for path in tmp_path.glob("*.log")) == list(dataset.truth.names)
    for grid in dataset.maps:
        ends = endpoints((tmp_path / f"{grid.name}.log").read_text().splitlines())
        cells = np.floor(grid.cells_from_points_map(ends)).astype(int)
        near = cv2.dilate(grid.occupied.astype(np.uint8), np.ones((3, 3), np.uint8))
        inside = np.all((cells >= 0) & (cells < near.shape), axis=1)
        assert inside.mean() > 0.99
        assert near[tuple(cells[inside].T)].mean() > 0.95


def endpoints(lines):
    """Where the beams of a log of 180 beams end, frame map."""
    points = []
    for words in (line.split() for line in lines if line.startswith("FLASER")):
        ranges = np.array(words[2:182], dtype=float)
        x, y, theta = map(float, words[182:185])
        angles = theta - np.pi / 2 + np.deg2rad(np.arange(180))
        hit = ranges < 20.0
        points.append(np.stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles)], axis=1)[hit])
    return np.concatenate(points)


def test_an_example_runs_alone_in_a_folder_without_the_project(tmp_path):
    shutil.copy(EXAMPLES / "mrpt_grid_matching.py", tmp_path)
    command = [sys.executable, "-I", "mrpt_grid_matching.py", "maps", "scans", "out"]
    done = subprocess.run(command, cwd=tmp_path, env={"PATH": ""}, capture_output=True, text=True, check=False)
    assert done.returncode == SKIP_STATUS
    assert done.stderr.strip() == "MRPT's carmen2simplemap and grid-matching not installed: apt-get install mrpt-apps"
