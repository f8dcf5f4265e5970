"""A short order of visits: nearest neighbour first, then 2-opt until nothing gets shorter."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_MAX_IMPROVEMENTS = 400


def shorten_tour(distance: Array, places: Indices) -> Indices:
    """Order places so that the open tour that begins at the first of them is short.

    Args:
        distance: (V, V) symmetric distances.
        places: (M,) indices to visit, M >= 1; the tour begins at ``places[0]``.

    Returns:
        (M,) the same places in a good order; the same input gives the same order.
    """
    tour = _nearest_neighbours(distance, places)
    for _ in range(_MAX_IMPROVEMENTS):
        if len(tour) < 4 or not _reverse_best(distance, tour):
            break
    return tour


def _nearest_neighbours(distance: Array, places: Indices) -> Indices:
    tour = [int(places[0])]
    left = np.ones(len(places), dtype=bool)
    left[0] = False
    for _ in range(len(places) - 1):
        away = np.where(left, distance[tour[-1], places], np.inf)
        nearest = int(np.argmin(away))
        left[nearest] = False
        tour.append(int(places[nearest]))
    return np.array(tour, dtype=np.int64)


def _reverse_best(distance: Array, tour: Indices) -> bool:
    """Reverse, in place, the stretch whose reversal shortens the open tour most; False if none does."""
    before, after = tour[:-1], np.append(tour[2:], -1)
    # Reversing tour[i + 1 .. j + 1] replaces the legs (i, i + 1) and (j + 1, j + 2); the last leg may not exist.
    first = tour[1:]
    leaves = np.where(after >= 0, distance[first, after], 0.0)
    joins = np.where(after[None, :] >= 0, distance[first[:, None], after[None, :]], 0.0)
    gain = distance[before, first][:, None] + leaves[None, :] - distance[before[:, None], first[None, :]] - joins
    gain[np.tril_indices(len(gain))] = -np.inf
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    if gain[i, j] <= 1e-9:
        return False
    tour[i + 1 : j + 2] = tour[i + 1 : j + 2][::-1].copy()
    return True
