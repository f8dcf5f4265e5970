"""Experiments from the command line to the folder of results, on a tiny building."""

import dataclasses
import functools
import io
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench import stages
from bench.__main__ import main
from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec, Outcome
from bench.command import compose_sim
from bench.plan import plan_cells
from bench.run import RunOptions, run_cells
from bench.settings import BenchSettings
from bench.stages import CellKeys
from bench.store import Store
from sim.config import SimConfig
from sim.maps.submaps import SubmapsConfig
from sim.sim_schema import register_schema

CONTRACT = {
    *("dataset", "world", "method", "seed", "status", "reason", "num_maps", "num_placed", "num_wrong", "success"),
    *("max_error_m", "max_error_deg", "median_error_m", "median_error_deg", "objective_initial", "objective"),
    *("edge_precision", "edge_recall", "runtime_s", "peak_memory_mb"),
}
TIMES = ("runtime", "peak_memory_mb")
HONEST = """
import json, pathlib, sys
names = sorted(path.stem for path in pathlib.Path(sys.argv[1]).glob("*.yaml"))
motion = {"x": 0.0, "y": 0.0, "theta": 0.0}
maps = {name: {"placed": k < 2, "component": min(k, 2) and k - 1, "T_ref_map": motion} for k, name in enumerate(names)}
pathlib.Path(sys.argv[2], "result.json").write_text(json.dumps({"schema": 1, "maps": maps}))
"""
FLOOD = "x = [bytearray(b'x' * 2**26) for _ in range(99)]\nimport time; time.sleep(9)"


def run(*arguments: str) -> int:
    """Run ``python -m bench`` in this process; its exit status."""
    before = sys.argv
    sys.argv = ["bench", *arguments]
    try:
        with pytest.raises(SystemExit) as ended:
            main()
    finally:
        sys.argv = before
    return int(ended.value.code or 0)


@pytest.fixture(scope="module")
def tiny(log_folder: Path) -> list[str]:
    """Overrides of the tiny building, cut into four."""
    return ["source=carmen", f"source.path={log_folder}/tiny.log", "submaps.count=4", "submaps.overlap=0.4"]


@pytest.fixture(scope="module")
def finished(tiny: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of ``paper`` on the tiny building with two seeds."""
    out = tmp_path_factory.mktemp("bench") / "out"
    assert run(*tiny, "methods=[paper]", "seeds=2", f"out={out}", "quiet=true") == 0
    return out


def scores_without_times(folder: Path) -> str:
    table = pd.read_csv(folder / "scores.csv")
    return table.drop(columns=[c for c in table if str(c).startswith(TIMES)]).to_csv(index=False)


def command(tmp_path: Path, source: str) -> str:
    """An external method made of these lines of Python."""
    program = tmp_path / "method.py"
    program.write_text(source)
    return f"{sys.executable} {program} {{maps}} {{out}}"


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store that the tests of external methods share, so that the dataset is made once."""
    return Store(tmp_path_factory.mktemp("store"))


def external_row(store: Store, config: SimConfig, command: str, retry_failed: bool = False, **limits: float) -> dict:
    """The scores of an external method on the tiny building."""
    method = MethodSpec("external", MethodKind.EXTERNAL, command, **limits)
    cell = Cell(DatasetSpec("tiny", config), method, seed=0)
    return run_cells([cell], store, RunOptions(retry_failed=retry_failed))[0].score


def test_the_folder_of_results_is_whole(finished: Path) -> None:
    table = pd.read_csv(finished / "scores.csv")
    assert set(table.columns) >= CONTRACT
    assert table["seed"].tolist() == [0, 1]
    assert (table["status"] == "ok").all()
    assert list(pd.read_parquet(finished / "scores.parquet").columns) == list(table.columns)
    assert (finished / "config.yaml").is_file()


def test_the_report_needs_nothing_else(finished: Path) -> None:
    html = (finished / "report.html").read_text()
    assert "http" not in html.replace("http://www.w3.org/", "").replace("http://purl.org/", "").replace(
        "http://creativecommons.org/", ""
    ).replace("https://matplotlib.org/", "")
    assert "<script" not in html
    assert html.count("<svg") == html.count('<svg aria-hidden="true"')
    assert html.count("<figure>") == html.count('role="img" aria-label="') > 0
    for picture in (finished / "figures").glob("*.svg"):
        assert picture.with_suffix(".csv").is_file()


def test_finished_cells_are_not_run_again(finished: Path, tiny: list[str]) -> None:
    before = (finished / "scores.csv").read_bytes()
    assert run(*tiny, "methods=[paper]", "seeds=2", f"out={finished}", "quiet=true") == 0
    assert (finished / "scores.csv").read_bytes() == before


def test_a_sweep_gathers_all_cells_and_names_the_swept_key(finished: Path, tiny: list[str]) -> None:
    swept = [word for word in tiny if not word.startswith("submaps.overlap")]
    arguments = [*swept, "submaps.overlap=0.3,0.4", "methods=[paper]", f"out={finished.parent / 'sweep'}", "quiet=true"]
    assert run("-m", *arguments) == 0
    table = pd.read_csv(finished.parent / "sweep" / "scores.csv")
    assert table["submaps.overlap"].tolist() == [0.3, 0.4]
    assert "Breaking points" in (finished.parent / "sweep" / "report.html").read_text()


def test_a_sweep_killed_at_random_moments_ends_as_one_that_ran_through(finished: Path, tiny: list[str]) -> None:
    out = finished.parent / "killed"
    arguments = [*tiny, "methods=[paper]", "seeds=2", f"out={out}", "quiet=true"]
    rng = random.Random(0)
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-m", "bench", *arguments], start_new_session=True)
        time.sleep(rng.uniform(1.5, 4.5))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert run(*arguments) == 0
    assert scores_without_times(out) == scores_without_times(finished)
    assert not list(out.rglob("*.tmp"))


def test_methods_share_one_dataset(tmp_path: Path, tiny_config: SimConfig) -> None:
    methods = [
        MethodSpec(name, MethodKind.EXTERNAL, f"{sys.executable} -c pass {name} {{maps}} {{out}}") for name in "ab"
    ]
    cells = [Cell(DatasetSpec("tiny", tiny_config), method, seed=0) for method in methods]
    scored = run_cells(cells, Store(tmp_path), RunOptions(workers=2))
    assert scored[0].dataset == scored[1].dataset
    assert len(list((tmp_path / "datasets").glob("[!.]*"))) == 1


def test_an_external_method_is_scored_like_any_other(tmp_path: Path, store: Store, tiny_config: SimConfig) -> None:
    row = external_row(store, tiny_config, command(tmp_path, HONEST))
    assert (row["status"], row["num_maps"], row["num_placed"], row["num_wrong"]) == ("ok", 4, 2, 1)
    assert not row["success"]
    assert row["peak_memory_mb"] > 1.0


def test_an_external_method_never_sees_the_truth(tmp_path: Path, store: Store, tiny_config: SimConfig) -> None:
    spy = "import pathlib, sys\nnear = list(pathlib.Path(sys.argv[1]).resolve().parent.rglob('*'))\n"
    spy += "assert not [p for p in near if 'truth' in p.name or p.name == 'dataset.json'], near\n"
    assert external_row(store, tiny_config, command(tmp_path, spy + HONEST))["status"] == "ok"


@pytest.mark.parametrize(
    ("source", "limits", "reason"),
    [
        ("import os; os.abort()", {}, "exit status -6"),
        ("import sys; sys.exit('no maps like these')", {}, "exit status 1: no maps like these"),
        ("import time; time.sleep(60)", {"time_limit_s": 1.0}, "time limit of 1 s"),
        (FLOOD, {"memory_limit_mb": 900.0}, "memory limit"),
        ("pass", {}, "no result.json was written"),
        ("import sys, pathlib; pathlib.Path(sys.argv[2], 'result.json').write_text('{')", {}, "not JSON"),
        (HONEST.replace("in enumerate(names)", "in enumerate(names[1:])"), {}, "partial: it leaves out map_00"),
        (HONEST.replace("in enumerate(names)", "in enumerate([*names, 'x'])"), {}, "maps that were not given: x"),
        (HONEST.replace('"x": 0.0', '"x": float("nan")'), {}, "T_ref_map.x' must be a finite number, got nan"),
        (
            "import os; [os.write(f, b'x' * 999 + b'\\n') for f in (1, 2) for _ in range(9999)]; os._exit(9)",
            {},
            "status 9",
        ),
    ],
)
def test_an_external_method_that_fails_is_a_row_with_its_reason(
    tmp_path: Path, store: Store, tiny_config: SimConfig, *, source: str, limits: dict[str, float], reason: str
) -> None:
    row = external_row(store, tiny_config, command(tmp_path, source), **limits)
    assert row["status"] == "failed"
    assert reason in row["reason"]
    assert (row["num_maps"], row["num_placed"], row["success"]) == (4, 0, False)


def test_an_external_method_that_cannot_run_here_is_skipped(
    tmp_path: Path, store: Store, tiny_config: SimConfig
) -> None:
    source = "import sys; print('needs open3d', file=sys.stderr); sys.exit(77)"
    row = external_row(store, tiny_config, command(tmp_path, source))
    assert (row["status"], row["reason"]) == ("skipped", "needs open3d")


def test_failures_are_remembered_and_retried_when_asked(tmp_path: Path, store: Store, tiny_config: SimConfig) -> None:
    flag = tmp_path / "fixed"
    source = f"import pathlib, sys\nif not pathlib.Path({str(flag)!r}).exists(): sys.exit(5)\n" + HONEST
    words = command(tmp_path, source)
    assert external_row(store, tiny_config, words)["status"] == "failed"
    flag.touch()
    assert external_row(store, tiny_config, words)["status"] == "failed"
    assert external_row(store, tiny_config, words, retry_failed=True)["status"] == "ok"


def test_a_dataset_that_cannot_be_made_is_a_row_with_its_reason(store: Store, tiny_config: SimConfig) -> None:
    config = dataclasses.replace(tiny_config, submaps=SubmapsConfig(count=100_000))
    row = external_row(store, config, f"{sys.executable} -c pass {{maps}} {{out}}")
    assert row["status"] == "failed"
    assert row["reason"].startswith("dataset: ")


def test_a_full_disk_ends_the_run_and_is_not_remembered_as_a_failure_of_the_dataset(
    store: Store, tiny_config: SimConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = Outcome("failed", "OSError: [Errno 28] No space left on device")
    finish = functools.partial(stages.finish_dataset, store, DatasetSpec("tiny", tiny_config), CellKeys(*"dyps"))
    with monkeypatch.context() as patch:
        patch.setattr(stages, "run_isolated", lambda *_: full)
        with pytest.raises(OSError, match="No space left"):
            finish(retry_failed=False)
    assert finish(retry_failed=False).status == "ok"


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["experiment=nonesuch"], "nonesuch"),
        (["nonesuch=1"], "nonesuch"),
        (["methods=[nonesuch]"], "unknown method 'nonesuch'"),
        (["seeds=0"], "seeds must be >= 1"),
        (["seeds=two"], "seeds"),
        (["submaps.overlap=7"], "overlap"),
        (["submaps.overlap=0.1,0.2"], "sweeps need -m"),
        (["method=external"], "method.command"),
        (["method=external", "method.command=prog"], "{maps}"),
        (["logs=nowhere", "experiment=table1"], "nowhere"),
        (["world=nowhere"], "nowhere"),
        (["table=nonesuch"], "table must be one of"),
        (["-m", "workers=1,2"], "workers is a setting of the whole run"),
        (["hydra/launcher=nonesuch"], "hydra/launcher/nonesuch"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], fault: str
) -> None:
    assert run(*arguments, f"out={tmp_path / 'out'}") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert fault in error
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_content_is_refused_and_left_as_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "thesis.tex").write_text("all my work")
    for out in (tmp_path, tmp_path / "thesis.tex", tmp_path / "thesis.tex" / "below"):
        assert run("world=tim", f"out={out}") == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_key_on_the_command_line_replaces_the_values_that_an_experiment_sweeps() -> None:
    register_schema()
    settings = BenchSettings(sweep={"submaps.overlap": [0.1, 0.2], "submaps.count": [2, 3]})
    cells = plan_cells(settings, ["submaps.overlap=0.4"], compose_sim)
    assert [(c.dataset.config.submaps.overlap, dict(c.dataset.swept)) for c in cells] == [
        (0.4, {"submaps.overlap": 0.4, "submaps.count": 2}),
        (0.4, {"submaps.overlap": 0.4, "submaps.count": 3}),
    ]


def test_the_help_lists_experiments_and_keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    text = capsys.readouterr().out
    assert "table1" in text
    assert "retry_failed" in text


def test_paper_places_the_tiny_building_right_or_says_why(finished: Path) -> None:
    table = pd.read_csv(io.StringIO((finished / "scores.csv").read_text()))
    assert np.isfinite(table["objective_floor"]).all()
    assert (table["num_placed"] >= 2).all()


def test_the_jobs_of_a_launcher_fill_the_store_and_are_gathered(finished: Path, tiny: list[str]) -> None:
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher", reason="hydra-submitit-launcher is not installed")
    out = finished.parent / "launched"
    words = ["methods=[paper]", "seeds=2", f"out={out}", "quiet=true", "hydra/launcher=local_processes"]
    assert run("-m", *tiny, *words) == 0
    assert scores_without_times(out) == scores_without_times(finished)
    assert list((out / "store" / "jobs" / ".submitit").iterdir())
