"""The wheel, installed into an empty environment, works outside the repository."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def run(*command: str | Path, cwd: Path) -> str:
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def python_of_empty_environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    python = folder / "venv" / "bin" / "python"
    pip = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    run(*pip, "--constraint", ROOT / "constraints.txt", wheel, cwd=folder)
    return python


@pytest.mark.slow
def test_wheel_simulates_merges_and_scores_outside_the_repository(
    python_of_empty_environment: Path, tmp_path: Path
) -> None:
    python = python_of_empty_environment
    where = run(python, "-c", "import bench, merger, sim; print(sim.__file__)", cwd=tmp_path)
    assert "site-packages" in where
    run(python, "-m", "sim", "world=tim", "out=tim", "submaps.count=2", cwd=tmp_path)
    run(python, "-m", "sim", "check", "tim", cwd=tmp_path)
    run(python, "-m", "merger", "tim", "--out", "merged", "--method", "paper", "--quiet", cwd=tmp_path)
    assert (tmp_path / "merged" / "result.json").is_file()
    assert "experiment" in run(python, "-m", "bench", "--help", cwd=tmp_path)
