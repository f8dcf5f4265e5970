"""Simulated datasets, from a world to a folder, on a tiny building."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.config import SimConfig
from sim.datasets.card import write_card
from sim.datasets.dataset import make_dataset, read_dataset
from sim.datasets.dataset_check import check_dataset
from sim.datasets.dataset_folder import file_sha256
from sim.maps.submap_mapping import MappingConfig, PoseSource
from sim.maps.submaps import SubmapsConfig
from sim.recordings.tum import read_tum
from sim.robot_run import LidarSpec
from sim.robots.robot import RobotConfig
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.source import check_source, make_source

WORLD = """
walls: [[[0, 0], [6, 0], [6, 5], [0, 5], [0, 0]], [[3, 0], [3, 3]]]
rooms: [{name: left, at: [1.5, 2]}, {name: right, at: [4.5, 2]}]
starts: [[1, 1, 0], [5, 1, 90]]
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> SimConfig:
    world = tmp_path_factory.mktemp("world") / "two_rooms.yaml"
    world.write_text(WORLD)
    return SimConfig(
        world=str(world),
        duration_s=6.0,
        robot=RobotConfig(radius_m=0.2),
        lidar=LidarSpec(60, -np.pi, 2 * np.pi / 60, 0.1, 8.0, 0.2),
        noise=NOISE_PRESETS["realistic"],
        submaps=SubmapsConfig(count=2),
        mapping=MappingConfig(PoseSource.ODOMETRY),
    )


@pytest.fixture(scope="module")
def folder(config: SimConfig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_dataset(config, tmp_path_factory.mktemp("made") / "two_rooms")


def test_a_simulated_dataset_is_sound_and_named_after_its_world(folder):
    assert check_dataset(folder) == []
    dataset = read_dataset(folder)
    assert dataset.name == "two_rooms-0"
    assert dataset.truth.robot == ("robot_0", "robot_1")


def test_the_card_tells_which_neighbours_miss_the_overlap_that_was_asked_for(folder, config, tmp_path):
    truth = replace(read_dataset(folder).truth, robot=("robot_0", "robot_0"), overlap=np.full((2, 2), 0.25))
    for target, words in ((0.26, "overlap by 0.26.\n"), (0.5, "no cut was found for map_00 and map_01 (0.25).\n")):
        asked = replace(config, submaps=SubmapsConfig(count=2, measured_overlap=target))
        write_card(tmp_path / "card.md", "two_rooms", asked, make_source(config), truth)
        assert words in (tmp_path / "card.md").read_text(encoding="utf-8")


def test_the_same_config_gives_the_same_bytes(folder, config, tmp_path):
    again = make_dataset(config, tmp_path / "again", workers=2)
    names = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
    assert [file_sha256(again / name) for name in names] == [file_sha256(folder / name) for name in names]


def test_another_noise_seed_leaves_the_true_ways_and_changes_odometry_and_ranges(folder, config, tmp_path):
    other = make_dataset(replace(config, noise_seed=99), tmp_path / "other")
    true, told = "trajectories/robot_0_truth.tum", "trajectories/robot_0_odometry.tum"
    assert (other / true).read_bytes() == (folder / true).read_bytes()
    assert (other / told).read_bytes() != (folder / told).read_bytes()
    assert (other / "scans.log").read_bytes() != (folder / "scans.log").read_bytes()


def test_scans_outside_every_submap_have_no_estimate(config, tmp_path):
    with_gaps = replace(config, submaps=SubmapsConfig(count=2, overlap=0.0))
    made = make_dataset(with_gaps, tmp_path / "x")
    stamps, _ = read_tum(made / "trajectories" / "robot_0_estimate.tum")
    truth = read_dataset(made).truth
    assert stamps[0] == truth.start_s[0]
    assert stamps[-1] == pytest.approx(truth.end_s[0])


def test_the_world_is_attached_with_every_surface(config):
    source = make_source(config)
    assert source.files["world.json"].count(b'"wall"') >= 6
    assert source.provenance == {"world": "two_rooms"}


def test_sources_are_checked_before_anything_runs(config, tmp_path):
    check_source(config)
    with pytest.raises(ValueError, match="nonsense"):
        check_source(replace(config, world="nonsense"))


def test_more_submaps_than_runs_can_have_scans_are_refused_before_anybody_drives(config, monkeypatch):
    monkeypatch.setattr("sim.source.simulate", lambda *_, **__: pytest.fail("somebody drives"))
    longer = replace(config, duration_s=10.0, submaps=SubmapsConfig(count=10_000))
    with pytest.raises(ValueError, match=r"at most the number of scans, \d+, got 10000"):
        make_source(longer)
