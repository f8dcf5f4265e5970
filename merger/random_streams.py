"""Random streams that depend on what they are for, not on when they are asked for."""

import hashlib

import numpy as np


def make_rng(seed: int, *names: str) -> np.random.Generator:
    """Make the random stream of the things with these names, the same in whatever order they are given.

    Args:
        seed: The seed of the whole merge.
        names: What the stream is for: the two maps of a pair, the maps of a component, a stage.
    """
    digest = hashlib.sha256("\0".join((str(seed), *sorted(names))).encode()).digest()
    return np.random.default_rng(np.random.SeedSequence(int.from_bytes(digest, "big")))
