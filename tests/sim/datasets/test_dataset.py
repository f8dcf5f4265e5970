"""A dataset is made whole from a log, reads back, and is the same every time."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from merger.map_server import read_map
from sim.config import SimConfig, SourceConfig, SourceKind, to_plain_dict
from sim.datasets.dataset import make_dataset, read_dataset
from sim.datasets.dataset_check import check_dataset
from sim.datasets.dataset_folder import DatasetError, file_sha256, new_folder, write_index
from sim.maps.submap_mapping import MappingConfig, PoseSource
from sim.maps.submaps import SubmapsConfig
from sim.recordings.carmen import read_carmen
from sim.recordings.tum import read_tum


@pytest.fixture
def config(tiny_config: SimConfig) -> SimConfig:
    return tiny_config


@pytest.fixture
def folder(tiny_dataset: Path, tmp_path: Path) -> Path:
    """A copy of the tiny dataset, that may be spoiled."""
    return Path(shutil.copytree(tiny_dataset, tmp_path / "tiny"))


def checksums(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): file_sha256(p) for p in folder.rglob("*") if p.is_file()}


def test_the_folder_holds_every_file_of_the_contract_and_is_sound(folder):
    names = set(checksums(folder))
    assert {
        "dataset.json",
        "recording.mcap",
        "truth.json",
        "scans.log",
        "world.png",
        "overview.png",
        "README.md",
    } <= names
    assert {f"maps/map_{k:02d}.{end}" for k in range(4) for end in ("yaml", "pgm")} <= names
    assert {f"trajectories/robot_{r}_{k}.tum" for r in range(2) for k in ("truth", "odometry", "estimate")} <= names
    assert check_dataset(folder) == []


def test_the_index_names_what_made_it_and_every_file(folder, config):
    index = json.loads((folder / "dataset.json").read_text())
    assert (index["schema"], index["name"], index["seed"]) == (1, "tiny-0", 0)
    assert index["config"] == json.loads(json.dumps(to_plain_dict(config)))
    assert index["files"] == {name: sha for name, sha in checksums(folder).items() if name != "dataset.json"}


def test_the_dataset_reads_back(folder):
    dataset = read_dataset(folder)
    assert [grid.name for grid in dataset.maps] == list(dataset.truth.names) == [f"map_{k:02d}" for k in range(4)]
    assert dataset.truth.robot == ("robot_0", "robot_0", "robot_1", "robot_1")
    assert dataset.truth.distortion_rms_m.max() < 1e-9


def test_walls_seen_by_all_maps_coincide_in_the_world(folder, make_runs):
    dataset = read_dataset(folder)
    for grid, T in zip(dataset.maps, dataset.truth.T_world_map, strict=True):
        x, y = se2.transform_points(T, grid.cell_centers(grid.occupied)).T
        box = np.minimum.reduce([abs(x), abs(x - 8.0), abs(y), abs(y - 6.0)])
        block = np.maximum(abs(x - 4.0), abs(y - 3.0)) - 0.5
        assert np.minimum(box, abs(block)).max() < 0.08


def test_trajectories_are_those_of_the_run(folder, tiny_log):
    for run in read_carmen(tiny_log):
        name, trajectory = run.trajectory.robot, run.trajectory
        stamps, truth = read_tum(folder / "trajectories" / f"{name}_truth.tum")
        assert np.allclose(stamps, trajectory.stamps_s, atol=1e-9)
        assert np.allclose(truth, trajectory.T_world_robot, atol=1e-8)
        assert np.allclose(read_tum(folder / "trajectories" / f"{name}_estimate.tum")[1], truth, atol=1e-8)
        odometry = read_tum(folder / "trajectories" / f"{name}_odometry.tum")[1]
        assert np.allclose(odometry, truth[0] @ trajectory.T_odom_robot, atol=1e-8)


def test_the_scan_log_makes_the_same_maps_again(folder, config, tmp_path):
    log = SourceConfig(SourceKind.CARMEN, str(folder / "scans.log"))
    again = make_dataset(replace(config, source=log), tmp_path / "again")
    for k in range(4):
        name = f"maps/map_{k:02d}.pgm"
        assert (again / name).read_bytes() == (folder / name).read_bytes()


def test_making_it_again_gives_the_same_bytes_whatever_the_number_of_workers(folder, config, tmp_path):
    assert checksums(make_dataset(config, tmp_path / "again", workers=2)) == checksums(folder)


def test_another_seed_gives_other_frames_of_the_same_submaps(folder, config, tmp_path):
    other = read_dataset(make_dataset(replace(config, seed=1), tmp_path / "other")).truth
    truth = read_dataset(folder).truth
    assert np.abs(other.T_world_map - truth.T_world_map).max() > 0.1
    assert np.array_equal(other.start_s, truth.start_s)


def test_odometry_bends_the_submaps_and_the_truth_says_how_much(config, tmp_path):
    bent = replace(config, mapping=MappingConfig(PoseSource.ODOMETRY))
    truth = read_dataset(make_dataset(bent, tmp_path / "bent")).truth
    assert (truth.distortion_rms_m > 1e-3).all()


def test_an_older_dataset_is_replaced_and_anything_else_is_not(folder, config):
    make_dataset(replace(config, seed=1), folder)
    assert read_dataset(folder).config["seed"] == 1
    (folder / "dataset.json").unlink()
    before = checksums(folder)
    with pytest.raises(DatasetError, match="something else than a dataset"):
        make_dataset(config, folder)
    with pytest.raises(DatasetError, match="is not a folder"):
        make_dataset(config, folder / "truth.json")
    assert checksums(folder) == before


def test_a_failure_leaves_nothing_behind(config, tmp_path):
    with pytest.raises(ValueError, match=r"submaps\.count"):
        make_dataset(replace(config, submaps=SubmapsConfig(count=1)), tmp_path / "new" / "x")
    assert not (tmp_path / "new").exists()

    def fill_and_fail() -> None:
        with new_folder(tmp_path / "new" / "x") as partial:
            write_index(partial, {})
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fill_and_fail()
    assert list((tmp_path / "new").iterdir()) == []


def spoil_cells(folder: Path) -> str:
    path = folder / "maps" / "map_01.pgm"
    data = bytearray(path.read_bytes())
    data[-5] ^= 0xFF
    path.write_bytes(data)
    return "map_01"


def spoil_truth(folder: Path) -> str:
    document = json.loads((folder / "truth.json").read_text())
    document["maps"]["map_02"]["T_world_map"]["x"] += 0.01
    (folder / "truth.json").write_text(json.dumps(document))
    return "map_02"


def spoil_trajectory(folder: Path) -> str:
    path = folder / "trajectories" / "robot_1_truth.tum"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:-1]) + "\n")
    return "robot_1_truth.tum"


def spoil_map_yaml(folder: Path) -> str:
    (folder / "maps" / "map_00.yaml").unlink()
    return "map_00.yaml"


def spoil_recording(folder: Path) -> str:
    path = folder / "recording.mcap"
    path.write_bytes(path.read_bytes()[:-100])
    return "recording.mcap"


def spoil_chunk(folder: Path) -> str:
    path = folder / "recording.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 50] = bytes(50)
    path.write_bytes(data)
    return "recording.mcap"


@pytest.mark.parametrize(
    "spoil", [spoil_chunk, spoil_cells, spoil_truth, spoil_trajectory, spoil_map_yaml, spoil_recording]
)
def test_the_check_names_a_file_that_has_been_changed_even_if_its_checksum_was_changed_too(folder, spoil):
    name = spoil(folder)
    assert any(name in fault for fault in check_dataset(folder))
    index = json.loads((folder / "dataset.json").read_text())
    (folder / "dataset.json").unlink()
    write_index(folder, {key: index[key] for key in ("name", "seed", "version", "config")})
    assert any(name in fault for fault in check_dataset(folder))


def test_the_check_compares_the_checksum_of_every_file(folder):
    with (folder / "README.md").open("a") as file:
        file.write(" ")
    assert check_dataset(folder) == [f"{folder}: README.md has changed (its SHA-256 differs)"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"alpha1": 0.1', '"alpha1": 0.2'),
        ('"duration_s"', '"durations"'),
        ('"seed": ', '"seed": 1'),
        ('"version": "', '"version": "9'),
        (" ", "\t"),
    ],
)
def test_the_check_names_an_index_that_has_been_changed(folder, old, new):
    text = (folder / "dataset.json").read_text()
    (folder / "dataset.json").write_text(text.replace(old, new, 1))
    assert old in text
    assert any(f"{folder}/dataset.json: " in fault for fault in check_dataset(folder))
    (folder / "dataset.json").write_text(text)


def test_the_check_names_missing_and_foreign_files_and_a_broken_index(folder):
    (folder / "world.png").unlink()
    (folder / "notes.txt").write_text("x")
    faults = "\n".join(check_dataset(folder))
    assert "world.png is missing" in faults
    assert "notes.txt does not belong" in faults
    (folder / "dataset.json").write_text('{"schema": 1}')
    assert "field 'name' is missing" in check_dataset(folder)[0]


def test_maps_can_be_read_by_any_map_server(folder):
    grid = read_map(folder / "maps" / "map_00.yaml")
    assert grid.occupied.any()
    assert grid.free.any()
