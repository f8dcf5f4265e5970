"""A fixed piece of work, timed beside every method, so that times can be compared between machines as ratios."""

import functools
import time

import cv2
import numpy as np

_SIZE = 256
_REPEATS = 5
_PERIOD_S = 10.0


def recent_reference() -> float:
    """`time_reference`, worked out anew every ten seconds: in a process that forks, it would cost each row 7 ms."""
    return _reference_in(int(time.monotonic() // _PERIOD_S))


@functools.lru_cache(maxsize=1)
def _reference_in(_period: int) -> float:
    return time_reference()


def time_reference() -> float:
    """Processor seconds of the fastest of five runs of an FFT, a distance transform and a sort, about 2 ms each.

    Processor time of this thread, and the least of five: neither waiting for a busy machine nor a cold cache counts.
    """
    image = np.random.default_rng(0).random((_SIZE, _SIZE))
    walls = (image > 0.98).astype(np.uint8)
    times = []
    for _ in range(_REPEATS):
        start = time.thread_time()
        np.fft.irfft2(np.fft.rfft2(image) ** 2)
        cv2.distanceTransform(1 - walls, cv2.DIST_L2, 5)
        np.sort(image, axis=None)
        times.append(time.thread_time() - start)
    return min(times)
