"""``python -m sim``: what is made, and what is refused in one line."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sim import __main__ as command_line
from sim.datasets.dataset import read_dataset

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """Runs the command line in an empty folder; gives exit status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["sim", *arguments])
        with pytest.raises(SystemExit) as caught:
            command_line.main()
        captured = capsys.readouterr()
        return int(caught.value.code or 0), captured.out, captured.err

    return call


def test_a_log_becomes_a_dataset_and_nothing_else_is_written(run, tiny_log, tmp_path):
    status, out, err = run(
        "source=carmen",
        f"source.path={tiny_log}",
        "submaps.count=4",
        "submaps.overlap=0.3",
        "seed=5",
        "quiet=true",
        "out=x",
    )
    assert (status, out, err) == (0, "", "")
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
    dataset = read_dataset(tmp_path / "x")
    assert dataset.config["seed"] == 5
    assert dataset.config["mapping"]["poses"] == "truth"
    assert len(dataset.maps) == 4
    assert run("check", "x")[:2] == (0, "sound: x\n")


def test_a_log_can_be_mapped_by_other_poses_than_the_truth(run, tiny_log, tmp_path):
    run("source=carmen", "mapping=odometry", f"source.path={tiny_log}", "submaps.count=2", "quiet=true", "out=x")
    assert read_dataset(tmp_path / "x").config["mapping"]["poses"] == "odometry"


def test_the_folder_made_is_named_on_stdout(run, tiny_log, tmp_path):
    status, out, err = run("source=carmen", f"source.path={tiny_log}", "submaps.count=2", "name=tiny")
    assert (status, out, err) == (0, "out/tiny\n", "")
    assert (tmp_path / "out" / "tiny" / "dataset.json").is_file()


def test_a_dataset_may_have_a_name_in_any_letters(run, tiny_log, tmp_path):
    status, _, err = run("source=carmen", f"source.path={tiny_log}", "submaps.count=2", "name=Büro 一", "out=x")
    assert (status, err) == (0, "")
    assert run("check", "x")[0] == 0
    assert read_dataset(tmp_path / "x").name == "Büro 一"


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["nonsense=1"], "nonsense"),
        (["mapping.nonsense=1"], "mapping.nonsense"),
        (["+more=1"], r"\+more=1"),
        (["~source"], "~source"),
        (["hydra.run.dir=x"], "hydra.run.dir"),
        (["nonsense"], "nonsense"),
        (["--nonsense"], "--nonsense"),
        (["noise=nonsense"], "noise/nonsense.*none"),
        (["lidar=nonsense"], "lidar/nonsense.*sick_lms_180"),
        (["source=nonsense"], "source/nonsense.*carmen"),
        (["seed=x"], "seed=x"),
        (["seed=1.5"], "seed=1.5"),
        (["seed=-1"], "seed must be >= 0, got -1"),
        (["seed=99999999999999999999"], "seed must be .* got 99999999999999999999"),
        (["seed=1,2"], "seed=1,2"),
        (["submaps=3"], "submaps=3"),
        (["submaps.count=0"], "submaps.count must be >= 1, got 0"),
        (["submaps.overlap=2"], "submaps.overlap must be in .* got 2"),
        (["mapping.poses=WRONG"], "WRONG"),
        (["mapping.occupancy.resolution_m=0"], r"resolution_m must be in \[0.002, 1\], got 0"),
        (["noise.range_sigma_m=-1"], "range_sigma_m must be .* got -1"),
        (["mapping.occupancy.resolution_m=1e-5"], "resolution_m must be in .* got 1e-05"),
        (["lidar.num_beams=1000000"], "num_beams .* within one turn, got 1000000 beams"),
        (["lidar.T_robot_lidar=[1,2]"], "T_robot_lidar must be three finite numbers"),
        (["lidar.T_robot_lidar=[5.0,0.0,0.0]"], "T_robot_lidar must be within robot.radius_m = 0.25"),
        (["num_robots=0"], "num_robots must be >= 1, got 0"),
        (["workers=0"], "workers must be >= 1, got 0"),
        (["world=nonsense"], "world 'nonsense' is unknown"),
        (["world=nonsense.yaml"], "nonsense.yaml: no such file"),
        (["source.path=x.log"], "source.path is read only with source=carmen"),
        (["source=carmen"], "source.path must name a CARMEN log"),
        (["source=carmen", "source.path=none.log"], "none.log: no such file"),
        (["source=carmen", "source.path=a (b), 'c.log"], "a \\(b\\), 'c.log: no such file"),
        (["source=carmen", "source.path=empty.log"], "empty.log: the log holds no scan"),
        (["noise.range_sigma_m=inf"], "range_sigma_m must be in .* got inf"),
        (["-m", "seed=1"], "-m needs a sweep"),
        (["-m", "seed=range(0,0)"], r"'seed=range\(0,0\)' is an empty sweep"),
        (["-m", "seed=glob(*)"], r"'seed=glob\(\*\)' is a sweep that is not known"),
        (["-m", "seed=1,2", "workers=1,2"], "workers is a setting of the whole run"),
        (["-m", "seed=1,2", "world=tim", "out=empty.log"], "empty.log/seed=1: cannot be written"),
        (["-m", "world=tim,nonsense"], "world 'nonsense' is unknown"),
        (["-m", "seed=1,2", "source=carmen", "source.path=none.log"], "none.log: no such file"),
        (["name=a/b"], "name must be a folder's name.* got 'a/b'"),
        (["out=empty.log/x", "source=carmen", "source.path=tiny.log"], "empty.log/x: cannot be written"),
        (["check"], "check needs"),
        (["compare", "x"], "compare needs"),
        (["compare", "x", "none.json"], r"none.json: cannot be read \(No such file"),
        (["compare", "x", "empty.log"], "empty.log: not a manifest"),
    ],
)
def test_bad_input_is_one_line_that_names_it_and_writes_nothing(run, tmp_path, tiny_log, arguments, fault):
    (tmp_path / "empty.log").touch()
    status, out, err = run(*(argument.replace("tiny.log", str(tiny_log)) for argument in arguments))
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert re.search(fault, err), err
    assert [path.name for path in tmp_path.iterdir()] == ["empty.log"]


def test_more_submaps_than_scans_are_refused(run, tiny_log, tmp_path):
    status, _, err = run("source=carmen", f"source.path={tiny_log}", "submaps.count=81", "quiet=true", "out=x")
    assert status == 2
    assert "submaps.count must be between" in err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_dataset_is_not_overwritten(run, tiny_log, tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "thesis.tex").write_text("all my work")
    status, _, err = run("source=carmen", f"source.path={tiny_log}", "out=x")
    assert status == 2
    assert "x: the folder holds something else" in err
    assert (tmp_path / "x" / "thesis.tex").read_text() == "all my work"


def test_the_check_says_what_is_wrong_with_exit_status_1(run, tiny_dataset, tmp_path):
    status, out, _ = run("check", str(tmp_path), str(tiny_dataset))
    assert status == 1
    assert out == f"{tmp_path}: not a dataset (no dataset.json)\n"


def test_a_dataset_is_compared_with_its_manifest(run, tiny_dataset, tmp_path):
    manifest = json.loads(run("manifest", str(tiny_dataset))[1])
    (tmp_path / "m.json").write_text(json.dumps(manifest))
    assert run("compare", str(tiny_dataset), "m.json") == (0, f"{tiny_dataset} is as m.json says\n", "")
    manifest["truth"]["maps"]["map_01"]["T_world_map"]["x"] += 1.0
    (tmp_path / "m.json").write_text(json.dumps(manifest))
    status, out, _ = run("compare", str(tiny_dataset), "m.json")
    assert (status, out) == (1, "map_01: its true place differs by 1.000 m, 0.0000 rad\n")
    del manifest["truth"]
    (tmp_path / "m.json").write_text(json.dumps(manifest))
    assert run("compare", str(tiny_dataset), "m.json") == (2, "", "sim: m.json: not a manifest of schema 1\n")


def test_help_lists_the_groups_with_their_choices_and_the_keys(run):
    status, out, _ = run("--help")
    assert status == 0
    assert "noise=high|low|none|realistic" in out
    assert "submaps.overlap=0.3" in out


def test_the_command_works_from_any_folder_without_leaving_anything_there(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "sim", "seed=x"],
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("sim: ")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_makes_a_collection(run, tiny_log, tmp_path):
    status, out, err = run(
        "-m",
        "seed=range(0,2)",
        "submaps.overlap=0.2,0.4",
        "source=carmen",
        f"source.path={tiny_log}",
        "submaps.count=2",
        "out=c",
        "workers=1",
    )
    assert (status, out) == (0, "c/collection.csv: 4 of 4 datasets\n")
    assert "datasets" in err
    made = sorted(path.name for path in (tmp_path / "c").iterdir())
    assert made == ["collection.csv", *(f"seed={s}_submaps.overlap={f}" for s in (0, 1) for f in (0.2, 0.4))]
    config = json.loads((tmp_path / "c" / made[-1] / "dataset.json").read_text())["config"]
    assert (config["seed"], config["submaps"]["overlap"]) == (1, 0.4)
