"""Other people's methods that come as examples: ``methods=[open3d,stitcher,mrpt]``; skipped where not installed."""

import shlex
import sys
from pathlib import Path

SHIPPED = {
    "open3d": "open3d_multiway.py {maps} {out}",
    "stitcher": "opencv_stitcher.py {maps} {out}",
    "mrpt": "mrpt_grid_matching.py {maps} {scans} {out}",
    "mrpt_pairwise": "mrpt_grid_matching.py --pairwise {maps} {scans} {out}",
}
"""Name of the method, and the program in ``bench/examples`` with its arguments."""


def shipped_command(name: str) -> str:
    """The command of a shipped method, run by this Python.

    Raises:
        KeyError: there is no such method.
    """
    program, _, arguments = SHIPPED[name].partition(" ")
    path = Path(__file__).parents[1] / "examples" / program
    return f"{shlex.quote(sys.executable)} {shlex.quote(str(path))} {arguments}"
