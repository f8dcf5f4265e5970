"""Whatever a method does in its process comes back as a record with a reason."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from bench.mergers.environment import original_environment
from bench.mergers.fork_server import Skipped
from bench.mergers.isolation import Limits, run_isolated

AMPLE = Limits(time_s=60.0, memory_mb=4096.0)


def _answer(value: float) -> dict[str, Any]:
    return {"wall_s": value}


def _raise(_: object) -> None:
    raise ValueError("bad\nmap")


def _skip(_: object) -> None:
    raise Skipped("no such program")


def _crash(_: object) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def _exit(_: object) -> None:
    os._exit(3)


def _sleep(seconds: float) -> None:
    time.sleep(seconds)


def _flood(mib: int) -> None:
    blocks = []
    for _ in range(mib // 16):
        blocks.append(bytearray(b"x" * (16 << 20)))
        time.sleep(0.02)
    time.sleep(30.0)


def _leave_behind(pid_file: Path, seconds: float) -> None:
    """Start a program in a session of its own that leaves another behind and ends; then go on for a while."""
    new = pid_file.with_suffix(".new")
    orphan = f"echo $$ > {new}; mv {new} {pid_file}; exec sleep 30"
    subprocess.run(["sh", "-c", f'sh -c "{orphan}" & exit'], start_new_session=True, check=True)
    while not pid_file.is_file():
        time.sleep(0.02)
    time.sleep(seconds)


def _ends(pid_file: Path) -> bool:
    try:
        orphan = psutil.Process(int(pid_file.read_text()))
    except psutil.NoSuchProcess:
        return True
    return not psutil.wait_procs([orphan], timeout=15.0)[1]


def test_programs_find_the_environment_that_the_user_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "3")
    before = dict(os.environ)
    run_isolated(_answer, (1.0,), AMPLE)
    assert dict(os.environ) == before
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("MAPMERGE_BENCH_ADDED", "OMP_NUM_THREADS")
    assert original_environment() == before


def test_an_answer_comes_back_with_its_peak_memory() -> None:
    outcome = run_isolated(_answer, (1.5,), AMPLE)
    assert (outcome.status, outcome.wall_s) == ("ok", 1.5)
    assert outcome.peak_memory_mb > 5.0


def test_an_exception_is_a_reason_in_one_line() -> None:
    outcome = run_isolated(_raise, (0,), AMPLE)
    assert (outcome.status, outcome.reason) == ("failed", "ValueError: bad map")


def test_what_cannot_run_here_is_skipped_with_its_reason() -> None:
    outcome = run_isolated(_skip, (0,), AMPLE)
    assert (outcome.status, outcome.reason) == ("skipped", "no such program")


def test_a_crash_is_named_by_its_signal() -> None:
    outcome = run_isolated(_crash, (0,), AMPLE)
    assert outcome.status == "failed"
    assert "SIGSEGV" in (outcome.reason or "")


def test_a_silent_end_is_a_failure() -> None:
    outcome = run_isolated(_exit, (0,), AMPLE)
    assert outcome.reason == "ended without an answer (exit status 3)"


def test_a_hang_is_stopped_by_the_time_limit() -> None:
    outcome = run_isolated(_sleep, (60.0,), Limits(time_s=0.3, memory_mb=4096.0))
    assert outcome.reason == "time limit of 0.3 s"


def test_a_flood_of_memory_is_stopped_by_the_memory_limit() -> None:
    outcome = run_isolated(_flood, (4096,), Limits(time_s=60.0, memory_mb=400.0))
    assert (outcome.reason or "").startswith("memory limit of 400 MiB")


def test_a_call_ends_when_the_program_that_asked_for_it_is_killed(tmp_path: Path) -> None:
    command = ["sh", "-c", f"echo $PPID > {tmp_path}/new; mv {tmp_path}/new {tmp_path}/pid; exec sleep 25"]
    run = f"run_isolated(subprocess.run, ({command},), Limits(90, 4096), Preload.NOTHING)"
    code = f"import subprocess; from bench.mergers.isolation import Limits, Preload, run_isolated; {run}"
    process = subprocess.Popen([sys.executable, "-c", code])
    while not (tmp_path / "pid").is_file():
        assert process.poll() is None
        time.sleep(0.1)
    call = psutil.Process(int((tmp_path / "pid").read_text()))
    process.kill()
    process.wait()
    gone, _ = psutil.wait_procs([call], timeout=20.0)
    assert gone == [call]


@pytest.mark.parametrize("limit_s", [60.0, 1.0])
def test_what_a_call_leaves_behind_ends_with_it_whatever_its_session(tmp_path: Path, limit_s: float) -> None:
    outcome = run_isolated(_leave_behind, (tmp_path / "pid", 0.0 if limit_s > 1.0 else 25.0), Limits(limit_s, 4096.0))
    assert outcome.status == ("ok" if limit_s > 1.0 else "failed")
    assert _ends(tmp_path / "pid")


@pytest.mark.parametrize("kill", [os.kill, os.killpg])
def test_what_a_call_has_left_behind_ends_when_the_program_or_its_group_is_killed(
    tmp_path: Path, kill: Callable[[int, int], None]
) -> None:
    command = ["sh", "-c", "sh -c 'echo $$ > new; mv new pid; exec sleep 30' & sleep 30"]
    options = {"cwd": str(tmp_path), "start_new_session": True}
    code = "import functools, subprocess; from bench.mergers.isolation import Limits, Preload, run_isolated; "
    call = f"functools.partial(subprocess.run, **{options}), ({command},), Limits(90, 4096), Preload.NOTHING"
    code += f"run_isolated({call})"
    process = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    while not (tmp_path / "pid").is_file():
        assert process.poll() is None
        time.sleep(0.05)
    kill(process.pid, signal.SIGKILL)
    process.wait()
    assert _ends(tmp_path / "pid")


def test_an_exit_status_that_a_method_chooses_is_told() -> None:
    assert run_isolated(sys.exit, (3,), AMPLE).reason == "ended without an answer (exit status 3)"


@pytest.mark.parametrize("wait", ["", "; server.wait_until_ready()"])
def test_a_server_that_is_never_asked_ends_with_its_program_without_a_word(wait: str) -> None:
    code = "from bench.mergers.servers import Preload, find_server; server = find_server(Preload.NOTHING)"
    code += f"{wait}; print(server.process.pid)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    with contextlib.suppress(psutil.NoSuchProcess):
        psutil.Process(int(done.stdout)).wait(timeout=20.0)
    assert done.stderr == ""
