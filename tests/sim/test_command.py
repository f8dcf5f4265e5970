"""The command on a card makes the dataset again, whatever made it."""

import shlex
from dataclasses import replace

import pytest

from sim.command import make_command, override_words
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.hydra_schema import build, compose_config
from sim.maps.submap_mapping import MappingConfig, PoseSource
from sim.maps.submaps import SubmapsConfig
from sim.resources import conf_folder
from sim.robots.people import PeopleConfig
from sim.robots.robot import RobotConfig
from sim.sensors.lidar_noise import NOISE_PRESETS
from sim.sensors.lidar_presets import LIDAR_PRESETS
from sim.sim_schema import ROOT, RunConfig, register_schema

CONFIGS = [
    SimConfig(),
    SimConfig(seed=7, name="a name", world="/some folder/it's.yaml", num_robots=3, duration_s=12.5, noise_seed=4),
    SimConfig(world="tim", noise=NOISE_PRESETS["high"], lidar=LIDAR_PRESETS["hokuyo_utm_30lx"]),
    SimConfig(noise=replace(NOISE_PRESETS["low"], dropout=1e-05, skew=False), robot=RobotConfig(radius_m=0.1)),
    SimConfig(lidar=replace(LIDAR_PRESETS["cheap_360"], num_beams=36, T_robot_lidar=(0.1, 0.0, -0.5))),
    SimConfig(people=PeopleConfig(num_people=3), submaps=SubmapsConfig(count=5, overlap=0.125)),
    SimConfig(
        source=SourceConfig(SourceKind.CARMEN, "logs/intel-corrected.log.gz"),
        mapping=MappingConfig(PoseSource.ODOMETRY),
    ),
    SimConfig(source=SourceConfig(SourceKind.CARMEN, "../a (b), 'c' = d.log"), mapping=MappingConfig(PoseSource.TRUTH)),
]


@pytest.mark.parametrize("config", CONFIGS)
def test_the_command_composes_to_the_same_config(config):
    register_schema()
    words = shlex.split(make_command(config, "x y"))
    assert words[:3] == ["python", "-m", "sim"]
    node = compose_config(conf_folder(), ROOT, words[3:])
    assert build(SimConfig, node) == config
    assert build(RunConfig, node).out == "out/x y"


def test_presets_are_named_not_spelled_out():
    words = override_words(SimConfig(world="tim", noise=NOISE_PRESETS["realistic"]))
    assert words == [
        "source=simulated",
        "mapping=scan_matched",
        "seed=0",
        "world=tim",
        "robot=pioneer",
        "lidar=sick_lms_180",
        "noise=realistic",
    ]
