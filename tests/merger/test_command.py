import json
import os
import re
import shutil
import subprocess
import sys

import cv2
import numpy as np
import pytest

from merger.__main__ import main
from merger.grid_map import GridMap
from merger.map_server import read_map, write_map

_FILES = ["graph.g2o", "merged.pgm", "merged.png", "merged.yaml", "result.json"]
_PAPER = ["--method", "paper", "--workers", "1"]


@pytest.fixture(scope="module")
def folder(three_maps, tmp_path_factory):
    path = tmp_path_factory.mktemp("maps")
    for grid in three_maps[0]:
        write_map(path / f"{grid.name}.yaml", grid)
    return path


def _result(out):
    return json.loads((out / "result.json").read_text())


def _without_times(out):
    return _result(out) | {"runtime_s": None}


def test_a_folder_of_maps_is_merged_and_the_files_of_the_contract_are_written(folder, tmp_path, capsys):
    assert main([str(folder), "--out", str(tmp_path / "a" / "b"), *_PAPER]) == 0
    out = tmp_path / "a" / "b"
    assert sorted(file.name for file in out.iterdir()) == _FILES
    document = _result(out)
    assert document["components"] == [["east", "middle", "west"]]
    assert document["reference"] == "east"
    merged = read_map(out / "merged.yaml")
    assert merged.resolution_m == 0.1
    assert merged.occupied.sum() > 1000
    assert cv2.imread(str(out / "merged.png")).shape[2] == 3
    captured = capsys.readouterr()
    assert "3 of 3 maps merged" in captured.out
    assert captured.err == ""


def test_the_command_runs_as_a_module_and_quietly(folder, tmp_path):
    command = [sys.executable, "-m", "merger", str(folder), "--out", str(tmp_path / "out"), *_PAPER, "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_order_of_the_files_changes_nothing_but_the_reference(folder, tmp_path):
    names = ["west", "east", "middle"]
    for number, order in enumerate((names, names[::-1])):
        files = [str(folder / f"{name}.yaml") for name in order]
        arguments = ["--reference", "middle", "--out", str(tmp_path / str(number)), *_PAPER, "--quiet"]
        assert main([*files, *arguments]) == 0
    assert _without_times(tmp_path / "0") == _without_times(tmp_path / "1")
    assert main([str(folder / f"{name}.yaml") for name in names] + ["--out", str(tmp_path / "2"), *_PAPER]) == 0
    assert _result(tmp_path / "2")["reference"] == "west"


def test_one_seed_gives_the_same_file_on_any_number_of_workers(folder, tmp_path):
    for workers in ("1", "3"):
        arguments = ["--seed", "5", "--workers", workers, "--method", "paper", "--quiet"]
        assert main([str(folder), "--out", str(tmp_path / workers), *arguments]) == 0
    assert _without_times(tmp_path / "1") == _without_times(tmp_path / "3")


def test_the_resolution_of_the_merged_map_can_be_chosen(folder, tmp_path):
    assert main([str(folder), "--out", str(tmp_path), "--resolution", "0.2", *_PAPER, "--quiet"]) == 0
    assert read_map(tmp_path / "merged.yaml").resolution_m == 0.2


def test_a_dataset_folder_gives_its_maps(folder, tmp_path):
    dataset = tmp_path / "dataset"
    (dataset / "maps").mkdir(parents=True)
    (dataset / "dataset.json").write_text("{}")
    for file in folder.iterdir():
        (dataset / "maps" / file.name).write_bytes(file.read_bytes())
    assert main([str(dataset), "--out", str(tmp_path / "out"), *_PAPER, "--quiet"]) == 0
    assert set(_result(tmp_path / "out")["maps"]) == {"east", "middle", "west"}


def test_maps_left_out_are_told_on_stderr_with_their_reasons(folder, tmp_path, capsys):
    write_map(tmp_path / "void.yaml", GridMap("void", np.zeros((9, 9), dtype=np.float32), 0.1))
    assert main([str(folder), str(tmp_path / "void.yaml"), "--out", str(tmp_path / "out"), *_PAPER]) == 0
    assert capsys.readouterr().err.startswith("left out: void: no other map matches it")


def test_if_nothing_can_be_merged_the_status_is_1_and_the_result_is_written(folder, tmp_path, capsys):
    write_map(tmp_path / "void.yaml", GridMap("void", np.zeros((9, 9), dtype=np.float32), 0.1))
    maps = [str(folder / "west.yaml"), str(tmp_path / "void.yaml")]
    assert main([*maps, "--out", str(tmp_path / "out"), *_PAPER]) == 1
    assert _result(tmp_path / "out")["components"] == [["void"], ["west"]]
    assert len(capsys.readouterr().err.splitlines()) == 2


def _spoil_empty(folder):
    (folder / "west.yaml").write_text("")
    return "west.yaml: the file is empty"


def _spoil_image(folder):
    (folder / "west.pgm").write_text("no image")
    return "west.yaml: its image west.pgm is not an image"


def _spoil_resolution(folder):
    text = (folder / "west.yaml").read_text().replace("resolution: 0.1", "resolution: 0")
    (folder / "west.yaml").write_text(text)
    return "west.yaml: resolution must be in [0.001, 100] m, got 0"


def _spoil_field(folder):
    lines = (folder / "west.yaml").read_text().splitlines()
    (folder / "west.yaml").write_text("\n".join(line for line in lines if not line.startswith("origin")))
    return "west.yaml: field 'origin' is missing"


def _spoil_size(folder):
    text = (folder / "west.yaml").read_text().replace("resolution: 0.1", "resolution: 0.05")
    (folder / "west.yaml").write_text(text)
    return "resolution of 0.05 m"


def _spoil_recording(folder):
    (folder / "west.mcap").write_bytes(b"no recording")
    return "west.mcap: not a whole MCAP file"


@pytest.mark.parametrize(
    "spoil", [_spoil_empty, _spoil_image, _spoil_resolution, _spoil_field, _spoil_size, _spoil_recording]
)
def test_bad_maps_are_told_in_one_line_and_nothing_is_written(folder, tmp_path, capsys, spoil):
    spoilt = tmp_path / "maps"
    spoilt.mkdir()
    for file in folder.iterdir():
        (spoilt / file.name).write_bytes(file.read_bytes())
    fault = spoil(spoilt)
    recordings = [str(file) for file in spoilt.glob("*.mcap")]
    assert main([str(spoilt), *recordings, "--out", str(tmp_path / "out"), *_PAPER]) == 2
    captured = capsys.readouterr()
    assert fault in captured.err
    assert len(captured.err.splitlines()) == 1
    assert captured.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["{maps}/none.yaml"], "none.yaml: no such file"),
        (["{maps}/none.mcap"], "none.mcap: no such file"),
        (["{empty}"], "the folder holds no map"),
        (["{maps}", "{maps}/west.yaml"], "the name 'west' is already that of"),
        (["{maps}", "--reference", "north"], "the reference 'north' is none of the maps"),
        (["{maps}", "--seed", "-1"], "seed must be >= 0"),
        (["{maps}", "--workers", "0"], "workers must be >= 1"),
        (["{maps}", "--resolution", "0"], "resolution must be in [0.001, 100] m, got 0"),
        (["{maps}", "--resolution", "nan"], "resolution must be in"),
        (["{maps}", "--resolution", "0.001"], "choose a larger resolution"),
        (["{maps}", "--method", "magic"], "invalid choice: 'magic'"),
        (["{maps}", "--seed", "two"], "invalid int value: 'two'"),
        (["{maps}", "--out", ""], "--out must name a folder, got ''"),
        (["{maps}", "--frobnicate"], "unrecognized arguments: --frobnicate"),
        ([], "the following arguments are required"),
    ],
)
def test_wrong_usage_is_told_in_one_line_and_nothing_is_written(folder, tmp_path, capsys, arguments, fault):
    (tmp_path / "empty").mkdir()
    places = {"maps": folder, "empty": tmp_path / "empty"}
    words = [word.format(**places) for word in arguments]
    try:
        status = main(["--method", "paper", "--out", str(tmp_path / "out"), *words])
    except SystemExit as stop:
        status = stop.code
    captured = capsys.readouterr()
    assert status == 2
    assert fault in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_result_is_written_whole_or_not_at_all(folder, tmp_path, capsys):
    (tmp_path / "result.json").mkdir()
    assert main([str(folder), "--out", str(tmp_path), *_PAPER]) == 2
    assert re.fullmatch(r"python -m merger: .* is a folder, no file: '.*result\.json'\n", capsys.readouterr().err)
    assert [file.name for file in tmp_path.iterdir()] == ["result.json"]


def test_hidden_files_of_a_folder_are_no_maps(folder, tmp_path):
    maps = shutil.copytree(folder, tmp_path / "maps")
    (maps / "._west.yaml").write_bytes(b"\0\5\x16\7")
    assert main([str(maps), "--out", str(tmp_path / "out"), *_PAPER, "--quiet"]) == 0


def test_a_folder_whose_name_is_no_text_can_be_written_to(folder, tmp_path, capsys):
    out = os.fsdecode(os.fsencode(tmp_path) + b"/\xff")
    assert main([str(folder), "--out", out, *_PAPER]) == 0
    assert capsys.readouterr().out.endswith("/\\xff\n")


@pytest.mark.parametrize(
    "ending",
    [
        (MemoryError(), 2, "python -m merger: not enough memory (none left)\n"),
        (OSError("disk\nfull"), 2, "python -m merger: disk full\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_what_ends_the_work_is_told_in_one_line(folder, tmp_path, capsys, monkeypatch, ending):
    fault, status, told = ending

    def fail(*_args, **_options):
        raise fault

    monkeypatch.setattr("merger.__main__.merge_maps", fail)
    assert main([str(folder), "--out", str(tmp_path / "out"), *_PAPER]) == status
    assert capsys.readouterr().err == told
    assert not (tmp_path / "out").exists()


def test_an_out_that_is_a_file_is_refused_before_the_work(folder, tmp_path, capsys):
    (tmp_path / "out").write_text("mine")
    assert main([str(folder), "--out", str(tmp_path / "out"), *_PAPER]) == 2
    assert "out: is not a folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "mine"
