"""One random stream for each purpose and robot, so that drawing more for one never changes another."""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is for; a number, once given, is never given to something else."""

    WORLD = 1
    """Generated buildings."""
    DRIVE = 2
    """Starts and routes."""
    PEOPLE = 3
    """People who walk about."""
    ODOMETRY = 4
    """Errors of odometry."""
    SUBMAP_FRAME = 5
    """Frames of the submaps."""


def make_stream(seed: int, purpose: Purpose, index: int = 0) -> np.random.Generator:
    """The generator of a purpose, and of one robot or person by its index."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose), index)))
