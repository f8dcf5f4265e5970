"""What a robot visits, place after place: a given route, or a tour that may go on for ever."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from sim.robots.coverage import Roadmap, more_visits

Errands = Iterator[tuple[int, float]]
"""Nodes to visit one after the other, each with an upper bound of the cost of the way from the one before."""


def route_errands(nodes: Sequence[int], endless: bool) -> Errands:
    """The nodes of a given route, once, or there and back for ever."""
    while True:
        yield from ((node, math.inf) for node in nodes)
        if not endless:
            return
        nodes = nodes[::-1]


def tour_errands(roadmap: Roadmap, start: int, tour: npt.NDArray[np.int64], rng: np.random.Generator | None) -> Errands:
    """The nodes of a tour, once, or, with a generator, for ever, each time in another order.

    Args:
        roadmap: The places.
        start: The place where the robot stands.
        tour: (M,) places in the order of the visits, M >= 1.
        rng: Makes the orders differ.
    """
    here, home = start, np.append(start, tour)
    while True:
        for place in tour:
            yield int(roadmap.nodes[place]), float(roadmap.distance_m[here, place]) * 1.001 + 0.1
            here = int(place)
        if rng is None:
            return
        tour = more_visits(roadmap, tour if len(set(tour)) > 1 else np.append(home, here), rng)
