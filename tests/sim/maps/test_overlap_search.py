"""Overlap can be asked for as it is measured in the maps."""

from pathlib import Path

import numpy as np
import pytest

from sim.config import SimConfig
from sim.datasets.dataset import make_dataset, read_dataset
from sim.maps.mapping import OccupancyConfig
from sim.maps.missed_overlaps import describe_missed, warn_of_missed
from sim.maps.seen_walls import find_seen_walls, overlap_of
from sim.maps.submaps import SubmapsConfig
from sim.maps.truth import Truth
from sim.robot_run import RobotRun
from sim.source import make_source


@pytest.mark.parametrize("target", [0.2, 0.5])
def test_every_two_neighbouring_submaps_overlap_by_what_was_asked_for(tmp_path: Path, target: float) -> None:
    submaps = SubmapsConfig(count=4, measured_overlap=target)
    config = SimConfig(world="tim", num_robots=1, duration_s=240.0, submaps=submaps)
    fraction = read_dataset(make_dataset(config, tmp_path / "tim")).truth.overlap
    neighbours = [(fraction[i, i + 1] + fraction[i + 1, i]) / 2.0 for i in range(3)]
    assert neighbours == pytest.approx([target] * 3, abs=0.03)


def test_an_overlap_that_no_cut_has_is_refused_with_the_nearest(tmp_path: Path) -> None:
    submaps = SubmapsConfig(count=2, measured_overlap=0.05)  # in five seconds a robot hardly leaves its place
    config = SimConfig(world="tim", num_robots=1, duration_s=5.0, submaps=submaps)
    with pytest.raises(
        ValueError, match=r"measured_overlap=0\.05 cannot be met with 2 submaps: the nearest is 0\.[1-9]"
    ):
        make_dataset(config, tmp_path / "tim")


def test_submaps_without_neighbours_are_refused(tmp_path: Path) -> None:
    config = SimConfig(world="tim", num_robots=2, duration_s=10.0, submaps=SubmapsConfig(count=2, measured_overlap=0.3))
    with pytest.raises(ValueError, match=r"measured_overlap=0\.3 needs neighbours, and 2 submaps of 2 runs have none"):
        make_dataset(config, tmp_path / "tim")


def test_every_pair_of_neighbours_that_misses_its_overlap_is_named_and_no_other(
    caplog: pytest.LogCaptureFixture,
) -> None:
    fraction = np.eye(4)
    fraction[0, 1] = fraction[1, 0] = fraction[2, 3] = fraction[3, 2] = 0.5
    fraction[1, 2], fraction[2, 1] = 0.1, 0.3  # maps of two robots are no neighbours
    names, robots, zeros = ("a", "b", "c", "d"), ("robot_0", "robot_0", "robot_1", "robot_1"), np.zeros(4)
    truth = Truth(names, np.tile(np.eye(3), (4, 1, 1)), zeros, robots, zeros, zeros, fraction)
    warn_of_missed(truth, 0.52)
    assert describe_missed(truth, 0.52) == caplog.messages == []
    fraction[3, 2] = 0.3
    warn_of_missed(truth, 0.52)
    assert describe_missed(truth, 0.52) == ["c and d (0.40)"]
    assert caplog.messages == ["submaps.measured_overlap=0.52 is met on average, but not by c and d (0.40)"]


@pytest.mark.parametrize("value", [0.0, 1.0, -0.1])
def test_an_overlap_out_of_range_is_refused_by_name(value: float) -> None:
    with pytest.raises(ValueError, match="measured_overlap"):
        SubmapsConfig(measured_overlap=value)


def test_masks_overlap_by_the_mean_share_of_cells_that_are_near_the_other() -> None:
    one, other = np.zeros((2, 40, 40), dtype=np.uint8)
    one[10, 5:25] = 1
    other[12, 5:15] = 1
    assert overlap_of(one, other) == overlap_of(other, one) == pytest.approx((12 / 20 + 1) / 2, abs=0.05)
    assert overlap_of(one, one) == 1.0
    assert overlap_of(one, np.zeros_like(one)) == 0.0


def test_a_part_sees_no_more_than_a_longer_one_and_the_whole_run_sees_every_block(run: RobotRun) -> None:
    walls = find_seen_walls(run, OccupancyConfig(), num_blocks=20)
    part, longer, whole = (walls.mask(0, stop) for stop in (50, 200, run.num_scans))
    assert 0 < part.sum() < longer.sum() < whole.sum()
    assert not (part & ~longer & 1).any()
    assert np.count_nonzero(whole) == len(np.unique(walls.cells))


@pytest.fixture(scope="module")
def run() -> RobotRun:
    return make_source(SimConfig(world="tim", num_robots=1, duration_s=60.0)).runs[0]
