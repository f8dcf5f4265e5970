"""Experiments from the command line to the folder of results, on a tiny building."""

import contextlib
import io
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest

from bench.__main__ import main
from bench.command import compose_sim
from bench.plan import plan_cells
from bench.settings import BenchSettings
from sim.sim_schema import register_schema

CONTRACT = {
    *("dataset", "world", "method", "seed", "status", "reason", "num_maps", "num_placed", "num_wrong", "success"),
    *("max_error_m", "max_error_deg", "median_error_m", "median_error_deg", "objective_initial", "objective"),
    *("edge_precision", "edge_recall", "runtime_s", "peak_memory_mb"),
}
TIMES = ("runtime", "peak_memory_mb")


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


def test_a_report_names_the_seeds_of_all_jobs(finished: Path, tiny: list[str], tmp_path: Path) -> None:
    out = shutil.copytree(finished, tmp_path / "out")
    assert run("-m", *tiny, "seed=0,1", "methods=[paper]", f"out={out}", "quiet=true") == 0
    page = re.sub(r"<[^>]+>", " ", (out / "report.html").read_text())
    assert re.search(r"seeds\s+0 to 1\s", page)


def test_a_run_that_is_interrupted_waits_for_no_method_and_ends_it(
    finished: Path, tiny: list[str], tmp_path: Path
) -> None:
    pid = tmp_path / "pid"
    program = tmp_path / "hang.sh"
    program.write_text(f"echo $$ > {pid}.new; mv {pid}.new {pid}; exec sleep 300\n")
    words = ["method=external", f"method.command=sh {program} {{maps}} {{out}}", f"out={finished.parent / 'stopped'}"]
    command = [sys.executable, "-m", "bench", *tiny, *words, "quiet=true"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not pid.is_file():
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    assert "what is finished is kept" in process.communicate(timeout=60)[1]
    assert process.returncode == 130
    with contextlib.suppress(psutil.NoSuchProcess):
        psutil.Process(int(pid.read_text())).wait(timeout=20.0)


def test_every_swept_key_is_a_column_whatever_it_concerns(log_folder: Path, tmp_path: Path) -> None:
    log = log_folder / "tiny.log"
    (tmp_path / "other.log").write_bytes(log.read_bytes())
    swept = [f"source.path={log},{tmp_path / 'other.log'}", "time_limit_s=20,30"]
    words = [*swept, "source=carmen", "submaps.count=4", "mapping=truth", "method=external", "quiet=true"]
    run("-m", *words, "method.command='true {maps} {out}','echo {maps} {out}'", f"out={tmp_path / 'out'}")
    table = pd.read_csv(tmp_path / "out" / "scores.csv")
    keys = ["source.path", "time_limit_s", "method.command"]
    assert len(table[keys].drop_duplicates()) == len(table) == 8


def test_a_sweep_killed_at_random_moments_ends_as_one_that_ran_through(finished: Path, tiny: list[str]) -> None:
    out = finished.parent / "killed"
    arguments = [*tiny, "methods=[paper]", "seeds=2", f"out={out}", "quiet=true"]
    rng = random.Random(0)
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-m", "bench", *arguments], start_new_session=True)
        time.sleep(rng.uniform(1.5, 4.5))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    (out / "store").mkdir(parents=True, exist_ok=True)
    (out / f"report.html@{socket.gethostname()}.{process.pid}.tmp").touch()
    assert run(*arguments) == 0
    assert scores_without_times(out) == scores_without_times(finished)
    assert not list(out.rglob("*.tmp"))


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
        (["-m", "submaps.overlap=interval(0.1,0.2)"], "use a,b,c or range"),
        (["-m", "seeds=range(3,1)"], "is an empty sweep"),
        (["sweep={submaps.overlap:[0.1,0.2]}"], "with -m KEY=A,B"),
        (["methods=paper"], "methods=[A,B]"),
        (["methods=[]"], "at least one method"),
        (["seeds=99999999999999999999"], "seeds must be <= 1000000"),
        (["--config-name=x"], "unknown option '--config-name=x'"),
        (["=5"], "'=5' is not of the form key=value"),
        (["title=\udcff"], "is not text on one line"),
        (["method=external"], "method.command"),
        (["method=external", "method.command=prog"], "{maps}"),
        (["logs=nowhere", "experiment=table1"], "nowhere"),
        (["world=nowhere"], "nowhere"),
        (["table=nonesuch"], "table must be one of"),
        (["-m", "workers=1,2"], "workers is a setting of the whole run"),
        (["hydra/launcher=nonesuch"], "hydra/launcher/nonesuch"),
        pytest.param(
            ["hydra/launcher=slurm"], "no srun", marks=pytest.mark.skipif(bool(shutil.which("srun")), reason="")
        ),
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


def test_a_run_without_an_ok_row_is_written_down_and_ends_with_status_1_and_one_line(
    finished: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = finished.parent / "vain"
    words = ["method=external", "method.command=false {maps} {out}", f"out={out}", "quiet=true"]
    assert run(*tiny, *words) == 1
    assert capsys.readouterr().err.splitlines() == [
        "bench: not one of 1 rows is ok; 1 failed: the command ended with exit status 1"
    ]
    assert pd.read_csv(out / "scores.csv")["status"].tolist() == ["failed"]


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
    assert "  workers=                   Cells run at a time" in text
    assert "  method.command=            The command of an external method" in text
    assert "  time_limit_s=600.0         Seconds after which" in text


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


def test_a_job_that_dies_is_one_line_and_what_is_finished_is_kept(
    finished: Path, tiny: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher", reason="hydra-submitit-launcher is not installed")
    out = finished.parent / "died"
    program = tmp_path / "kill.py"
    program.write_text(
        "import psutil\nfor p in psutil.process_iter(['cmdline']):\n    words = ' '.join(p.info['cmdline'] or [])\n"
        f"    if 'submitit.core._submit' in words and {str(out)!r} in words: p.kill()\n"
    )
    words = ["method=external", f"method.command={sys.executable} {program} {{maps}} {{out}}", "quiet=true"]
    assert run("-m", *tiny, *words, f"out={out}", "hydra/launcher=local_processes") == 2
    error = capsys.readouterr().err
    assert error.startswith("bench: a job ended early")
    assert error.count("\n") == 1
    assert len(list((out / "store" / "datasets").glob("[!.]*/dataset.json"))) == 1
