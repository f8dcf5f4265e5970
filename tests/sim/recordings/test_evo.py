"""The drift that was put into odometry is what evo measures, if evo is installed: it is never a dependency."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from sim.recordings.tum import read_tum

EVO = shutil.which("evo_ape")


@pytest.mark.skipif(EVO is None, reason="evo is not installed (pip install evo)")
@pytest.mark.parametrize("kind", ["mcap", "tum"])
def test_evo_measures_the_drift_that_was_put_in(tiny_dataset, kind):
    trajectories = tiny_dataset / "trajectories"
    truth, told = (read_tum(trajectories / f"robot_0_{name}.tum")[1] for name in ("truth", "odometry"))
    drift = np.sqrt(np.mean(np.sum((truth[:, :2, 2] - told[:, :2, 2]) ** 2, axis=1)))
    files = {
        "mcap": [str(tiny_dataset / "recording.mcap"), "/robot_0/ground_truth/pose", "/robot_0/odom"],
        "tum": [str(trajectories / f"robot_0_{name}.tum") for name in ("truth", "odometry")],
    }
    done = subprocess.run([str(EVO), kind, *files[kind]], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert float(re.findall(r"rmse\s+(\S+)", done.stdout)[0]) == pytest.approx(drift, abs=1e-5)
