"""Overlap can be asked for as it is measured in the maps."""

from pathlib import Path

import pytest

from sim.config import SimConfig
from sim.datasets.dataset import make_dataset, read_dataset
from sim.maps.submaps import SubmapsConfig


@pytest.mark.parametrize("target", [0.3, 0.5])
def test_neighbouring_submaps_overlap_by_what_was_asked_for(tmp_path: Path, target: float) -> None:
    submaps = SubmapsConfig(count=4, measured_overlap=target)
    config = SimConfig(world="tim", num_robots=1, duration_s=240.0, submaps=submaps)
    fraction = read_dataset(make_dataset(config, tmp_path / "tim")).truth.overlap
    neighbours = [(fraction[i, i + 1] + fraction[i + 1, i]) / 2.0 for i in range(3)]
    assert sum(neighbours) / 3 == pytest.approx(target, abs=0.03)


def test_an_overlap_that_no_cut_has_is_refused_with_the_nearest(tmp_path: Path) -> None:
    submaps = SubmapsConfig(count=4, measured_overlap=0.999)
    config = SimConfig(world="tim", num_robots=1, duration_s=60.0, submaps=submaps)
    with pytest.raises(ValueError, match=r"measured_overlap=0\.999 cannot be met with 4 submaps"):
        make_dataset(config, tmp_path / "tim")


@pytest.mark.parametrize("value", [0.0, 1.0, -0.1])
def test_an_overlap_out_of_range_is_refused_by_name(value: float) -> None:
    with pytest.raises(ValueError, match="measured_overlap"):
        SubmapsConfig(measured_overlap=value)
