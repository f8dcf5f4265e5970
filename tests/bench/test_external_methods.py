"""Other people's programs: whatever they do is a row of the scores, with its reason, and nothing is left behind."""

import dataclasses
import functools
import sys
import tempfile
from pathlib import Path

import pytest

from bench import stages
from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec, Outcome
from bench.run import RunOptions, run_cells
from bench.stages import CellKeys
from bench.store import Store
from sim.config import SimConfig
from sim.maps.submaps import SubmapsConfig

HONEST = """
import json, pathlib, sys
names = sorted(path.stem for path in pathlib.Path(sys.argv[1]).glob("*.yaml"))
motion = {"x": 0.0, "y": 0.0, "theta": 0.0}
maps = {name: {"placed": k < 2, "component": min(k, 2) and k - 1, "T_ref_map": motion} for k, name in enumerate(names)}
pathlib.Path(sys.argv[2], "result.json").write_text(json.dumps({"schema": 1, "maps": maps}))
"""
FLOOD = "x = [bytearray(b'x' * 2**26) for _ in range(99)]\nimport time; time.sleep(9)"


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


@pytest.mark.parametrize("place", [1, 2])
def test_an_external_method_never_sees_the_truth(
    tmp_path: Path, store: Store, tiny_config: SimConfig, place: int
) -> None:
    spy = f"import pathlib, sys\nnear = list(pathlib.Path(sys.argv[{place}]).resolve().parent.rglob('*'))\n"
    spy += f"assert not pathlib.Path(sys.argv[{place}]).resolve().is_relative_to({str(store.root)!r})\n"
    spy += "assert not [p for p in near if 'truth' in p.name or p.name == 'dataset.json'], near\n"
    assert external_row(store, tiny_config, command(tmp_path, spy + HONEST))["status"] == "ok"


@pytest.mark.parametrize(
    ("source", "limits", "reason"),
    [
        ("import os; os.abort()", {}, "exit status -6 (SIGABRT)"),
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


@pytest.mark.parametrize(
    ("vandalism", "status"),
    [
        ("import pathlib, sys; [p.write_bytes(b'poison') for p in pathlib.Path(sys.argv[1]).iterdir()]\n", "ok"),
        ("import pathlib, shutil, sys; shutil.rmtree(pathlib.Path(sys.argv[2]))\n", "failed"),
        ("import os, sys; os.mkfifo(sys.argv[2] + '/result.json'); os._exit(0)\n", "failed"),
    ],
)
def test_what_a_method_does_to_its_folders_harms_nobody_else(
    tmp_path: Path, store: Store, tiny_config: SimConfig, vandalism: str, status: str
) -> None:
    source = HONEST.replace("names =", "names = [f'map_0{k}' for k in range(4)] or")
    assert external_row(store, tiny_config, command(tmp_path, vandalism + source))["status"] == status
    (tmp_path / "next").mkdir()
    assert external_row(store, tiny_config, command(tmp_path / "next", HONEST))["num_wrong"] == 1


@pytest.mark.parametrize("source", ["import time; time.sleep(60)", "import os; os.kill(os.getppid(), 9)"])
def test_a_method_that_is_stopped_leaves_no_folder_behind(
    tmp_path: Path, store: Store, tiny_config: SimConfig, monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    said = f"import pathlib; assert {str(place)!r} in str(pathlib.Path(sys.argv[1]))\n"
    row = external_row(store, tiny_config, command(tmp_path, "import sys\n" + said + source), time_limit_s=1.0)
    assert row["reason"] in ("time limit of 1 s", "crashed with SIGKILL")
    assert not list(place.iterdir())


def test_the_end_of_what_a_command_says_lies_beside_its_answer(tmp_path: Path, tiny_config: SimConfig) -> None:
    source = "import sys; print('x' * 9000 + '\\nfirst\\nlast', file=sys.stderr); sys.exit(3)"
    row = external_row(Store(tmp_path / "own"), tiny_config, command(tmp_path, source))
    (log,) = (tmp_path / "own" / "predictions").glob("*/stderr.txt")
    assert row["reason"].endswith("exit status 3: last")
    assert log.read_text().endswith("x\nfirst\nlast\n")
    assert len(log.read_text()) < 5000


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
