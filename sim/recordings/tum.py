"""Trajectories in TUM's format, as evo and others read them: ``timestamp tx ty tz qx qy qz qw`` a line."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from merger import se2


def write_tum(path: Path, stamps_s: npt.NDArray[np.float64], T: npt.NDArray[np.float64]) -> None:
    """Write poses in the order of their stamps, 9 decimals.

    Args:
        path: The file to write.
        stamps_s: (N,) seconds since the run began.
        T: (N, 3, 3) poses.
    """
    order = np.argsort(stamps_s, kind="stable")
    half = se2.angle_of(T) / 2.0
    rows = np.stack([stamps_s, T[:, 0, 2], T[:, 1, 2], np.sin(half), np.cos(half)], axis=-1)[order]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("# timestamp tx ty tz qx qy qz qw\n")
        file.writelines("{:.9f} {:.9f} {:.9f} 0 0 0 {:.9f} {:.9f}\n".format(*row) for row in rows.tolist())


def read_tum(path: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Read (N,) stamps in seconds and (N, 3, 3) planar poses.

    Raises:
        ValueError: a line is not eight numbers.
    """
    rows = np.loadtxt(path, dtype=np.float64, ndmin=2)
    if rows.shape[1] != 8:
        raise ValueError(f"{path}: a TUM line has 8 numbers, got {rows.shape[1]}")
    return rows[:, 0], se2.make_motion(rows[:, 1], rows[:, 2], 2.0 * np.arctan2(rows[:, 6], rows[:, 7]))
