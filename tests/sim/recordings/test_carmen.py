"""Logs are read as they are published, and refused with a line that says why."""

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from merger import se2
from sim.recordings.carmen import beam_angles, no_return_reading, read_carmen
from sim.recordings.carmen_lines import LogError
from sim.recordings.scan_log import write_scan_log

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def flaser(ranges: list[float], pose: str = "1 2 0.5", odom: str = "0 0 0", time: str = "10.5") -> str:
    return f"FLASER {len(ranges)} {' '.join(map(str, ranges))} {pose} {odom} {time} host {time}\n"


def read_text(folder: Path, text: str):
    path = folder / "x.log"
    path.write_text(text)
    return read_carmen(path)


@pytest.mark.parametrize(
    ("count", "step_deg", "last_deg"), [(180, 1.0, 89.0), (181, 1.0, 90.0), (360, 0.5, 89.5), (361, 0.5, 90.0)]
)
def test_even_counts_of_beams_leave_out_the_end_point_and_odd_ones_include_it(count, step_deg, last_deg):
    first, step = beam_angles(count)
    assert math.degrees(first) == pytest.approx(-90.0)
    assert math.degrees(step) == pytest.approx(step_deg)
    assert math.degrees(first + step * (count - 1)) == pytest.approx(last_deg)


def test_poses_stamps_and_ranges_are_those_of_the_lines_in_the_files_order(tmp_path):
    text = flaser([1.0, 2.0], "1 2 0.5", "5 0 0", "12") + "ODOM 0 0 0 0 0 0 11 host 11\n"
    run = read_text(tmp_path, text + flaser([3.0, 4.0], "2 2 0.25", "6 1 0", "11.5"))[0]
    assert run.trajectory.stamps_s.tolist() == [0.5, 0.0]
    assert np.allclose(se2.parameters_of(run.trajectory.T_world_robot), [[1, 2, 0.5], [2, 2, 0.25]])
    assert np.allclose(se2.parameters_of(run.trajectory.T_odom_robot), [[0, 0, 0], [1, 1, 0]])
    assert run.read_ranges(0, 2).tolist() == [[1, 2], [3, 4]]
    assert run.read_ranges(1, 2).tolist() == [[3, 4]]


def robotlaser(ranges: list[float], remissions: str = "0", max_m: float = 30.0) -> str:
    lidar = f"0 -1.0 2.0 0.25 {max_m} 0.01 0 {len(ranges)} {' '.join(map(str, ranges))} {remissions}"
    return f"ROBOTLASER1 {lidar} 1 2 0.5 5 1 0.25 0.1 0 0.3 0.2 1e6 10.5 host 10.6\n"


def test_newer_scan_lines_say_what_lidar_they_are_of(tmp_path):
    for remissions in ("0", "2 7 8"):
        run = read_text(tmp_path, robotlaser([1.0, 30.0, 0.0], remissions) * 2)[0]
        assert run.read_ranges(0, 2).tolist() == [[1.0, np.inf, -np.inf]] * 2
        assert np.allclose(run.lidar.angles_rad, [-1.0, -0.75, -0.5])
        assert run.lidar.range_max_m == 30.0
        assert np.allclose(se2.parameters_of(run.trajectory.T_world_robot), [[1, 2, 0.5]] * 2)
        assert run.trajectory.stamps_s.tolist() == [0.0, 0.0]


def test_older_scan_lines_count_where_a_log_has_both(tmp_path):
    run = read_text(tmp_path, robotlaser([1.0, 2.0, 3.0]) + flaser([4.0, 5.0]))[0]
    assert run.read_ranges(0, run.num_scans).tolist() == [[4.0, 5.0]]
    assert np.allclose(run.lidar.angles_rad, [-np.pi / 2, 0.0])


def test_a_stated_maximum_just_above_the_sensors_own_is_its_own(tmp_path):
    for text in (
        robotlaser([1.0, 81.83, 81.91], max_m=81.92),
        "PARAM robot_front_laser_max 82\n" + flaser([1, 81.83, 81.9]),
    ):
        run = read_text(tmp_path, text)[0]
        assert run.read_ranges(0, 1).tolist() == [[1.0, np.inf, np.inf]]


@pytest.mark.parametrize("line", ["ROBOTLASER1", robotlaser([1.0])[:60], robotlaser([]), robotlaser([1.0], "9")])
def test_newer_scan_lines_that_break_off_are_refused(tmp_path, line):
    with pytest.raises(LogError, match="line 1: malformed ROBOTLASER1 line"):
        read_text(tmp_path, line)


def test_readings_at_or_above_the_sensors_maximum_are_no_return(tmp_path):
    run = read_text(tmp_path, flaser([1.0, 81.83, 81.91, 0.0]))[0]
    assert run.read_ranges(0, 1).tolist() == [[1.0, np.inf, np.inf, -np.inf]]
    assert run.lidar.range_max_m == 81.83
    run = read_text(tmp_path, "PARAM robot_front_laser_max 30.0 nohost 0\n" + flaser([1.0, 29.9, 30.0, 31.0]))[0]
    assert run.read_ranges(0, 1)[0, 1] == np.float32(29.9)
    assert np.isposinf(run.read_ranges(0, 1)[0, 2:]).all()


@pytest.mark.parametrize(("readings", "limit"), [([1.0, 50.0], 50.0), ([1.0, 81.91], 81.83), ([3.0, 3.0], math.inf)])
def test_the_maximum_is_found_where_the_log_does_not_say_it(readings, limit):
    assert no_return_reading(np.array([readings], dtype=np.float32)) == limit


def test_a_frequent_largest_reading_is_the_maximum_and_a_rare_one_is_a_wall():
    ranges = np.linspace(1.0, 20.0, 10_000, dtype=np.float32)[None]
    assert no_return_reading(ranges) == math.inf
    assert no_return_reading(np.minimum(ranges, 18.0)) == pytest.approx(18.0)


def test_the_logs_own_resolution_of_the_lidar_counts(tmp_path):
    run = read_text(tmp_path, "PARAM laser_front_laser_resolution 0.25 host 0\n" + flaser([1.0] * 40))[0]
    assert math.degrees(run.lidar.angle_increment_rad) == pytest.approx(0.25)
    assert math.degrees(run.lidar.angle_min_rad) == pytest.approx(-5.0)


def test_a_run_written_as_a_log_is_read_back_the_same(tmp_path, make_runs):
    runs = make_runs(num_robots=2)
    write_scan_log(tmp_path / "scans.log", runs, "x")
    back = read_carmen(tmp_path / "scans.log")
    assert [run.trajectory.robot for run in back] == ["robot_0", "robot_1"]
    for run, read in zip(runs, back, strict=True):
        assert np.array_equal(read.read_ranges(0, 99), run.read_ranges(0, 99))
        assert np.abs(read.trajectory.stamps_s - run.trajectory.stamps_s).max() == 0.0
        assert np.abs(read.trajectory.T_world_robot - run.trajectory.T_world_robot).max() < 1e-12
        assert np.abs(read.trajectory.T_odom_robot - run.trajectory.T_odom_robot).max() < 1e-12
        assert read.lidar.T_robot_lidar == pytest.approx(run.lidar.T_robot_lidar)
        assert read.lidar.angles_rad == pytest.approx(run.lidar.angles_rad)
        assert (read.lidar.range_min_m, read.lidar.range_max_m) == (run.lidar.range_min_m, run.lidar.range_max_m)
        assert read.lidar.time_increment_s == run.lidar.time_increment_s


def test_ranges_that_are_not_millimetres_survive_the_log(tmp_path, make_runs):
    run = make_runs()[0]
    odd = np.full((40, 90), 1.0 / 3.0, dtype=np.float32)
    write_scan_log(tmp_path / "scans.log", [type(run)(run.trajectory, run.lidar, lambda a, b: odd[a:b])], "x")
    assert np.array_equal(read_carmen(tmp_path / "scans.log")[0].read_ranges(0, 40), odd)


def test_a_range_at_the_lidars_very_end_is_no_missing_return(tmp_path, make_runs):
    run = make_runs()[0]
    ends = np.full((40, 90), 5.5, dtype=np.float32)
    ends[:, 0] = np.inf
    write_scan_log(tmp_path / "scans.log", [type(run)(run.trajectory, run.lidar, lambda a, b: ends[a:b])], "x")
    assert np.array_equal(read_carmen(tmp_path / "scans.log")[0].read_ranges(0, 40), ends)


def test_a_gzipped_log_is_read_whatever_its_name(tmp_path):
    (tmp_path / "x.log").write_bytes(gzip.compress(flaser([1.0, 2.0]).encode()))
    assert read_carmen(tmp_path / "x.log")[0].num_scans == 1


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "no scan"),
        ("ODOM 0 0 0 0 0 0 1 host 1\n", "no scan"),
        ("FLASER 3 1.0 2.0\n", "line 1: malformed FLASER"),
        ("FLASER x\n", "line 1: malformed FLASER"),
        (flaser([1.0]) + flaser([1.0, 2.0]), "line 2: malformed FLASER"),
        (flaser([1.0], pose="a b c"), "line 1: malformed FLASER"),
        (flaser([1.0], pose="nan 0 0"), "not finite"),
        ("PARAM laser_front_laser_resolution 0 x 0\n" + flaser([1.0]), "laser_front_laser_resolution must be"),
    ],
)
def test_a_faulty_log_is_refused_in_one_line_that_names_it(tmp_path, text, fault):
    with pytest.raises(LogError, match=fault) as caught:
        read_text(tmp_path, text)
    assert "x.log" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_damaged_file_is_refused(tmp_path):
    with pytest.raises(LogError, match="no such file"):
        read_carmen(tmp_path / "none.log")
    (tmp_path / "x.log.gz").write_bytes(gzip.compress(flaser([1.0] * 90).encode())[:40])
    with pytest.raises(LogError, match="cannot be read"):
        read_carmen(tmp_path / "x.log.gz")
    with pytest.raises(LogError, match="cannot be read"):
        read_carmen(tmp_path)


@pytest.mark.parametrize(
    ("name", "scans", "beams", "step_deg", "limit"),
    [("intel", 910, 180, 1.0, 81.83), ("freiburg-079", 4791, 360, 0.5, 80.99), ("aces", 440, 180, 1.0, 50.0)],
)
def test_published_logs_are_read_as_their_publishers_describe_them(name, scans, beams, step_deg, limit):
    path = DATA / f"{name}-corrected.log.gz"
    if not path.is_file():
        pytest.skip(f"no real log at {path}")
    run = read_carmen(path)[0]
    assert (run.num_scans, run.lidar.num_beams) == (scans, beams)
    assert math.degrees(run.lidar.angle_increment_rad) == pytest.approx(step_deg)
    assert run.lidar.range_max_m == pytest.approx(limit)
    ranges = run.read_ranges(0, scans)
    assert 0.005 < np.mean(np.isinf(ranges)) < 0.05
    assert ranges[np.isfinite(ranges)].max() < limit
