"""Scan skew undone: how the lidar moves while the beams of a scan leave one after the other."""

import numpy as np
import numpy.typing as npt

from merger import se2
from sim.robot_run import LidarSpec


def motion_per_beam(
    T_frame_lidar: npt.NDArray[np.float64], stamps_s: npt.NDArray[np.float64], lidar: LidarSpec
) -> npt.NDArray[np.float64]:
    """How a lidar moves from one beam to the next, if it goes on evenly from each scan's stamp to the following one.

    Args:
        T_frame_lidar: (S, 3, 3) poses of the lidar at the scans' first beams, true, told or estimated.
        stamps_s: (S,) times of these beams.
        lidar: The lidar.

    Returns:
        (S, 3) shift x, y in metres and turn in radians, frame ``lidar`` at the first beam; the last scan moves as the
        one before it; 0 where time stands still, and for a lidar that takes whole scans at once.
    """
    motions = np.zeros((len(stamps_s), 3))
    if len(stamps_s) < 2 or lidar.time_increment_s == 0.0:
        return motions
    steps = se2.parameters_of(se2.invert(T_frame_lidar[:-1]) @ T_frame_lidar[1:])
    periods_s = np.diff(stamps_s)
    beams = np.divide(lidar.time_increment_s, periods_s, out=np.zeros(len(periods_s)), where=periods_s > 0.0)
    motions[:-1] = steps * beams[:, None]
    motions[-1] = motions[-2]
    return motions
