import os
import subprocess
import sys
from pathlib import Path

import pytest

from bench.gates.merge_gate import MergeGateConfig, run_merge_gate, score_on_dataset
from bench.mergers.merger_call import load_merger, merger_command
from merger.pipeline import merge_maps

ROOT = Path(__file__).parents[2]
SUITE = """
import os
from dataclasses import replace
from merger import se2
from merger.pipeline import MergeConfig, merge_maps
from merger.result import Method

def merge(maps):
    result = merge_maps(list(maps), MergeConfig(method=Method.PAPER, composite=False))
    if "BROKEN" in os.environ:
        last = result.maps[-1]
        moved = replace(last, T_ref_map=last.T_ref_map @ se2.make_motion(1.0, 0.0, 0.0))
        result = replace(result, maps=(*result.maps[:-1], moved))
    return result

def test_function(merge_gate):
    merge_gate("function.json", merger=merge, datasets=[{dataset!r}])
"""


@pytest.fixture
def suite(tmp_path, dataset):
    (tmp_path / "test_mine.py").write_text(SUITE.replace("{dataset!r}", repr(str(dataset.path))))
    return tmp_path


def run_suite(folder, *options, **environment):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "bench.pytest_plugin", "-p", "no:cacheprovider", *options]
    settings = {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(ROOT)} | environment
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=os.environ | settings)
    return done.returncode, done.stdout + done.stderr


def test_a_suite_of_ones_own_is_green_until_its_merger_gets_worse(suite):
    status, text = run_suite(suite)
    assert status == 1
    assert "merge_gate: " in text
    assert "--merge-gate-update) makes it" in text
    assert "Traceback" not in text
    assert run_suite(suite, "--merge-gate-update")[0] == 0
    assert (suite / "function.json").is_file()
    assert run_suite(suite)[0] == 0
    status, text = run_suite(suite, BROKEN="1")
    assert status == 1
    assert "x merger, seed 0: num_wrong got worse: 0 -> 1 (tolerance 0)" in text


def test_a_command_is_run_by_the_bench_on_data_that_overrides_describe(tmp_path, log_folder):
    config = MergeGateConfig(
        baseline=tmp_path / "command.json",
        command=f"{sys.executable} -m merger {{maps}} --out {{out}} --method paper --quiet",
        overrides=("source=carmen", f"source.path={log_folder / 'tiny.log'}", "submaps.count=3", "mapping=truth"),
        name="mine",
    )
    (tmp_path / "run").mkdir()
    comparison = run_merge_gate(config, tmp_path / "run", update=True)
    assert comparison.findings == ()
    assert dict(comparison.cells[0].cell)["method"] == "mine"


def test_a_failure_becomes_no_baseline(tmp_path, dataset):
    config = MergeGateConfig(tmp_path / "b.json", command="false {maps} {out}", datasets=(dataset.path,))
    assert score_on_dataset(config, dataset.path, tmp_path / "once").status == "failed"
    with pytest.raises(ValueError, match="no baseline from a run that failed"):
        run_merge_gate(config, tmp_path / "twice", update=True)
    assert not (tmp_path / "b.json").exists()


def test_a_merger_is_given_once_and_with_something_to_merge(tmp_path):
    with pytest.raises(ValueError, match="either command"):
        MergeGateConfig(tmp_path / "b.json", overrides=("world=tim",))
    with pytest.raises(ValueError, match="needs datasets"):
        MergeGateConfig(tmp_path / "b.json", merger=merge_maps)


def test_a_function_is_found_by_its_file_or_its_module_and_a_lambda_is_refused():
    assert load_merger("merger.pipeline:merge_maps") is merge_maps
    assert "merger/pipeline.py:merge_maps" in merger_command(merge_maps)
    with pytest.raises(ValueError, match="top level of a module"):
        merger_command(lambda maps: {})
    with pytest.raises(ValueError, match=r"no merger 'merger\.pipeline:nothing'"):
        load_merger("merger.pipeline:nothing")
