"""Our own methods on two buildings with two seeds, against the baseline that is kept with the tests."""

import subprocess
import sys
from pathlib import Path

import pytest

from bench.gate import GateConfig, check_gate, describe
from bench.gates.tolerances import ANOTHER_MACHINE

ROOT = Path(__file__).parents[2]
BASELINE = ROOT / "tests" / "bench" / "baselines" / "full.json"
UPDATE = f"python -m bench experiment=guard_full out=DIR; python -m bench.gate DIR --baseline {BASELINE} --update"


def test_our_own_methods_are_as_good_as_their_full_baseline(benchmark, tmp_path):
    if benchmark.disabled:
        pytest.skip("takes minutes: runs with --benchmark-enable")
    command = [sys.executable, "-m", "bench", "experiment=guard_full", f"out={tmp_path}", "quiet=true"]
    benchmark.pedantic(subprocess.run, args=(command,), kwargs={"cwd": ROOT, "check": True}, rounds=1, iterations=1)
    comparison = check_gate(GateConfig(tmp_path, BASELINE, ANOTHER_MACHINE))
    assert comparison.findings == (), f"{describe(comparison)}\nif this is meant: {UPDATE}"
    assert comparison.new == ()
