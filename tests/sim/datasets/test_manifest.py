"""The published presets: one is made again and compared, and a manifest notices what differs."""

import copy
import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from sim.config import SimConfig, to_plain_dict
from sim.datasets.dataset import make_dataset
from sim.datasets.dataset_check import check_dataset
from sim.datasets.manifest import compare_manifest, make_manifest
from sim.hydra_schema import build, compose_config
from sim.resources import conf_folder
from sim.sim_schema import ROOT, register_schema

ROOT_FOLDER = Path(__file__).resolve().parents[3]
PRESETS = sorted((conf_folder() / "preset").glob("*.yaml"))


def config_of(preset: str) -> SimConfig:
    register_schema()
    return build(SimConfig, compose_config(conf_folder(), ROOT, [f"preset={preset}"]))


def test_the_preset_tim_can_be_made_again_as_it_was_published(tmp_path):
    manifest = json.loads((conf_folder() / "preset" / "tim.json").read_text())
    folder = tmp_path / "tim"
    command = [sys.executable, "-m", "sim", "preset=tim", f"out={folder}", "workers=2", "quiet=true"]
    subprocess.run(command, cwd=ROOT_FOLDER, check=True)
    assert compare_manifest(folder, manifest) == []
    assert check_dataset(folder) == []


def test_the_preset_tim_is_the_same_in_a_process_that_has_let_opencv_use_other_threads(tmp_path):
    manifest = json.loads((conf_folder() / "preset" / "tim.json").read_text())
    before = cv2.getNumThreads()
    cv2.setNumThreads(1 if before > 1 else 2)
    try:
        folder = make_dataset(config_of("tim"), tmp_path / "tim")
    finally:
        cv2.setNumThreads(before)
    assert compare_manifest(folder, manifest) == []


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_every_preset_has_a_manifest_of_its_own_configuration(path):
    manifest = json.loads(path.with_suffix(".json").read_text())
    config = config_of(path.stem)
    assert manifest["name"] == path.stem
    assert manifest["config"] == json.loads(json.dumps(to_plain_dict(config)))
    assert {"dataset.json", "recording.mcap", "truth.json"} <= set(manifest["files"])


def test_a_manifest_agrees_with_its_own_dataset_and_notices_every_difference(tiny_dataset):
    manifest = json.loads(json.dumps(make_manifest(tiny_dataset)))
    assert compare_manifest(tiny_dataset, manifest) == []
    changes = [
        ("truth", "maps", "map_01", "T_world_map", "x", 0.1, "map_01: its true place"),
        ("truth", "maps", "map_02", "T_world_map", "theta", 0.01, "map_02: its true place"),
        ("maps", "map_00", "occupied", 100, "map_00: .* occupied"),
        ("config", "seed", 1, "configuration"),
        ("files", "scans.log", "x", "scans.log: its checksum"),
    ]
    for *path, change, fault in changes:
        spoiled = copy.deepcopy(manifest)
        inner = spoiled
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] += change
        (message,) = compare_manifest(tiny_dataset, spoiled)
        assert re.search(fault, message)


def test_checksums_may_differ_on_another_platform(tiny_dataset):
    manifest = make_manifest(tiny_dataset)
    manifest["platform"] = {**manifest["platform"], "cpu": "another"}
    manifest["files"] = {}
    assert compare_manifest(tiny_dataset, manifest) == []
