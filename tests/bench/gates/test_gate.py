import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from bench.gate import main
from bench.gates.baseline import read_baseline, write_baseline
from bench.gates.rows import read_rows

NESTED = '{"schema": 1, "rows": [{"cell": {"x": [1]}, "seed": 0, "status": "ok", "scores": {}}]}'
ROOT = Path(__file__).parents[3]


def table(**changes):
    """Scores of two datasets, two methods and three seeds, with every column that the contract lists."""
    rows = []
    for dataset, method, seed in [(d, m, s) for d in ("intel", "079") for m in ("paper", "robust") for s in range(3)]:
        row = {"dataset": dataset, "world": dataset, "method": method, "seed": seed, "status": "ok", "reason": None}
        row |= {"num_maps": 8, "num_placed": 8, "num_wrong": 0, "success": True, "max_error_m": 0.02 + 0.001 * seed}
        row |= {"max_error_deg": 0.1, "median_error_m": 0.01, "median_error_deg": 0.05, "objective_initial": 0.4}
        row |= {"objective": 0.3, "edge_precision": 1.0, "edge_recall": 0.9, "runtime_s": 1.0, "peak_memory_mb": 180.0}
        rows.append(row | {"submaps.overlap": 0.3} | changes)
    return pd.DataFrame(rows)


def write(folder, frame):
    folder.mkdir(parents=True, exist_ok=True)
    frame.to_csv(folder / "scores.csv", index=False)
    return str(folder)


@pytest.fixture
def baseline(tmp_path):
    path = tmp_path / "baseline.json"
    assert main([write(tmp_path / "before", table()), "--baseline", str(path), "--update", "--quiet"]) == 0
    return str(path)


def test_an_unchanged_run_is_green(tmp_path, baseline, capsys):
    assert main([write(tmp_path / "after", table()), "--baseline", baseline]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "time of paper: 1.00 times the baseline's in seconds, not judged",
        "time of robust: 1.00 times the baseline's in seconds, not judged",
        "gate: no score got worse, 12 rows of 4 cells compared",
    ]


def test_what_got_worse_is_a_table_and_the_exit_status_is_1(tmp_path, baseline, capsys):
    after = table()
    after.loc[4, ["num_wrong", "success"]] = [1, False]
    assert main([write(tmp_path / "after", after), "--baseline", baseline]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["cell", "seed", "score", "before", "after", "tolerance"]
    assert lines[2].startswith("intel x robust [submaps.overlap=0.3]")
    assert lines[2].split()[-6:] == ["seed", "1", "success", "1", "0", "0"]
    assert lines[-1].startswith("gate: 3 scores got worse")


def test_the_order_of_rows_and_columns_does_not_matter(tmp_path, baseline):
    shuffled = table().sample(frac=1.0, random_state=1)
    shuffled = shuffled[list(reversed(shuffled.columns))]
    assert main([write(tmp_path / "after", shuffled), "--baseline", baseline, "--quiet"]) == 0


def test_junit_has_a_case_a_cell_and_a_failure_that_says_what_got_worse(tmp_path, baseline):
    after = table()
    after.loc[0, "max_error_m"] = np.nan
    main([write(tmp_path / "after", after), "--baseline", baseline, "--quiet", "--junit", str(tmp_path / "gate.xml")])
    root = ElementTree.parse(tmp_path / "gate.xml").getroot()
    assert root.attrib == {"tests": "4", "failures": "1", "errors": "0"}
    assert root.find("testsuite").attrib == {"name": "bench.gate", **root.attrib, "skipped": "0"}
    assert len(root.findall("./testsuite/testcase")) == 4
    (failure,) = root.iter("failure")
    assert failure.get("message").startswith("intel x paper [submaps.overlap=0.3], seed 0: max_error_m got worse")


def test_junit_can_be_read_whatever_a_program_has_said(tmp_path, baseline):
    after = table()
    after.loc[0, ["status", "reason"]] = ["failed", "\x1b[31mred\x00 & <dead> \uffff"]
    main([write(tmp_path / "after", after), "--baseline", baseline, "--quiet", "--junit", str(tmp_path / "gate.xml")])
    (failure,) = ElementTree.parse(tmp_path / "gate.xml").getroot().iter("failure")
    assert "ok -> failed: red & <dead>" in failure.get("message")


def test_a_run_without_an_ok_row_becomes_no_baseline(tmp_path, capsys):
    folder = write(tmp_path / "after", table(status="failed", reason="boom"))
    assert main([folder, "--baseline", str(tmp_path / "b.json"), "--update"]) == 2
    assert "no baseline from a run without an ok row" in capsys.readouterr().err
    assert not (tmp_path / "b.json").exists()


def test_cells_that_the_baseline_knows_as_failed_are_named_as_not_judged(tmp_path, capsys):
    before = table()
    before.loc[before["dataset"] == "079", ["status", "reason"]] = ["failed", "boom"]
    main([write(tmp_path / "before", before), "--baseline", str(tmp_path / "b.json"), "--update", "--quiet"])
    assert main([write(tmp_path / "after", table()), "--baseline", str(tmp_path / "b.json")]) == 0
    said = "without a result in the baseline, not judged: 079 x paper [submaps.overlap=0.3]"
    assert said in capsys.readouterr().out


def test_a_tolerance_of_ones_own_is_obeyed(tmp_path, baseline):
    folder = write(tmp_path / "after", table(max_error_m=0.4))
    assert main([folder, "--baseline", baseline, "--quiet"]) == 1
    assert main([folder, "--baseline", baseline, "--quiet", "--tolerance", "max_error_m=1"]) == 0


def test_a_baseline_without_costs_neither_keeps_nor_judges_time_and_memory(tmp_path):
    path, folder = str(tmp_path / "b.json"), write(tmp_path / "a", table(runtime_ratio=50.0))
    assert main([folder, "--baseline", path, "--update", "--no-costs", "--quiet"]) == 0
    assert {"runtime_s", "runtime_ratio", "peak_memory_mb"}.isdisjoint(
        json.loads(Path(path).read_text())["rows"][0]["scores"]
    )
    slow = write(tmp_path / "slow", table(runtime_ratio=5e3, peak_memory_mb=9e9))
    assert main([slow, "--baseline", path, "--quiet"]) == 0
    assert main([folder, "--baseline", path, "--update", "--quiet"]) == 0
    assert main([slow, "--baseline", path, "--quiet"]) == 1
    assert main([slow, "--baseline", path, "--quiet", "--no-costs"]) == 0


def test_another_machine_is_allowed_what_another_seed_does(tmp_path, baseline):
    folder = write(tmp_path / "after", table(max_error_m=0.04, edge_recall=0.8))
    assert main([folder, "--baseline", baseline, "--quiet"]) == 1
    assert main([folder, "--baseline", baseline, "--quiet", "--another-machine"]) == 0
    wrong = write(tmp_path / "wrong", table(num_wrong=1, success=False))
    assert main([wrong, "--baseline", baseline, "--quiet", "--another-machine"]) == 1


def test_update_takes_the_new_scores(tmp_path, baseline):
    folder = write(tmp_path / "after", table(num_wrong=1, success=False))
    assert main([folder, "--baseline", baseline, "--quiet"]) == 1
    assert main([folder, "--baseline", baseline, "--quiet", "--update"]) == 0
    assert main([folder, "--baseline", baseline, "--quiet"]) == 0


def test_a_baseline_is_sorted_one_row_a_line_and_the_same_for_any_order(tmp_path, baseline):
    shuffled = write(tmp_path / "shuffled", table().sample(frac=1.0, random_state=2))
    main([shuffled, "--baseline", str(tmp_path / "other.json"), "--update", "--quiet"])
    text = Path(baseline).read_text()
    assert text == (tmp_path / "other.json").read_text()
    assert len(text.splitlines()) == 12 + 2
    assert len(json.loads(text)["rows"]) == 12


def test_a_baseline_that_is_read_and_written_again_is_the_same(tmp_path, baseline):
    write_baseline(tmp_path / "again.json", read_baseline(Path(baseline)))
    assert (tmp_path / "again.json").read_bytes() == Path(baseline).read_bytes()


def test_names_stay_text_and_whole_numbers_are_integers_however_they_are_written(tmp_path):
    (row, *_) = read_rows(Path(write(tmp_path / "a", table(**{"submaps.count": 8.0}))) / "scores.csv")
    assert ("submaps.count", 8) in row.cell
    assert dict(read_rows(tmp_path / "a" / "scores.csv")[-1].cell)["dataset"] == "079"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda f: f.drop(columns="success"), "no column success"),
        (lambda f: f.iloc[:0], "holds no row"),
        (lambda f: pd.concat([f, f]), "is there twice"),
        (lambda f: f.assign(seed="first"), "seed must be an integer, got 'first'"),
        (lambda f: f.assign(max_error_m="far"), "max_error_m must be a number, got 'far'"),
    ],
)
def test_malformed_scores_are_one_line_and_exit_status_2(tmp_path, baseline, capsys, make, message):
    assert main([write(tmp_path / "bad", make(table())), "--baseline", baseline]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize(
    "text",
    [
        None,
        "",
        "{",
        "[" * 100_000,
        "[]",
        '{"schema": 1, "rows": 5}',
        NESTED,
        '{"schema": 9, "rows": [{}]}',
        '{"schema": 1, "rows": [{}]}',
    ],
)
def test_a_malformed_baseline_is_one_line_and_exit_status_2(tmp_path, capsys, text):
    path = tmp_path / "b.json"
    if text is not None:
        path.write_text(text)
    assert main([write(tmp_path / "a", table()), "--baseline", str(path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_command_line_ends_with_the_status(tmp_path, baseline):
    command = [sys.executable, "-m", "bench.gate", str(tmp_path / "nowhere"), "--baseline", baseline]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("bench.gate: ")
    assert "Traceback" not in done.stderr
