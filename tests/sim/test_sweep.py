"""A sweep names every config once, as hydra would compose it."""

import pytest

from sim.config import SimConfig
from sim.hydra_schema import OverrideError, build, compose_config
from sim.resources import conf_folder
from sim.sim_schema import GROUPS, ROOT, register_schema
from sim.sweep import SweepPoint, expand_sweep


def expand(*words: str) -> list[SweepPoint]:
    register_schema()
    return expand_sweep(conf_folder(), ROOT, words, GROUPS)


def test_the_last_key_changes_fastest_and_labels_name_the_swept_values():
    points = expand("seed=range(0,2)", "noise=none,high", "world=tim")
    assert [point.label for point in points] == [
        "seed=0_noise=none",
        "seed=0_noise=high",
        "seed=1_noise=none",
        "seed=1_noise=high",
    ]
    assert points[1].parameters == {"seed": "0", "noise": "high"}


def test_every_point_is_what_hydra_composes_alone():
    for point in expand("noise=none,high", "submaps.overlap=0.1,0.5", "world=tim"):
        words = [f"{key}={value}" for key, value in point.parameters.items()]
        alone = compose_config(conf_folder(), ROOT, [*words, "world=tim"])
        assert build(SimConfig, point.config) == build(SimConfig, alone)


def test_labels_are_fit_for_folders():
    labels = [point.label for point in expand("world=tim,/tmp/x.yaml,'a b'")]
    assert labels == ["world=tim", "world=_tmp_x.yaml", "world=_a_b_"]


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["seed=1"], "needs a sweep"),
        (["seed=1,x"], "seed=x"),
        (["submaps.nonsense=1,2"], "nonsense"),
        (["noise=none,nonsense"], "nonsense"),
        (["world=a/b,a_b"], "two datasets of the sweep"),
    ],
)
def test_what_cannot_be_swept_is_refused(words, fault):
    with pytest.raises(OverrideError, match=fault):
        expand(*words)
