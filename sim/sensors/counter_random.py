"""Random numbers that are a function of a key and a counter, so that no draw depends on what was drawn before.

Sources: the finaliser of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014);
the ziggurat of Marsaglia and Tsang, "The ziggurat method for generating random variables", 2000, with 256 layers.
"""

import math
import zlib

import numpy as np
import numpy.typing as npt
from numba import njit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFT_1, _SHIFT_2, _SHIFT_3 = np.uint64(30), np.uint64(27), np.uint64(31)
_MANTISSA_SHIFT = np.uint64(11)
_LAYER_MASK = np.uint64(255)
_TO_UNIT = 2.0**-53

_TAIL = 3.6541528853610088
"""Where the ziggurat's tail begins."""
_LAYER_AREA = 0.00492867323399


def stream_key(seed: int, *names: str) -> np.uint64:
    """The key of the stream that a seed and names (of a robot, of an effect) stand for."""
    key = np.array([seed], dtype=np.uint64)
    for name in names:
        key = _mixed(key + np.array([zlib.crc32(name.encode())], dtype=np.uint64) * _GOLDEN)
    return np.uint64(key[0])


@njit(cache=True, nogil=True)
def hash_counter(key, counter):  # type: ignore[no-untyped-def] # a kernel
    """64 random bits of a stream at a place: both are uint64."""
    z = key + counter * _GOLDEN
    z = (z ^ (z >> _SHIFT_1)) * _MIX_1
    z = (z ^ (z >> _SHIFT_2)) * _MIX_2
    return z ^ (z >> _SHIFT_3)


@njit(cache=True, nogil=True)
def uniform_at(key, counter):  # type: ignore[no-untyped-def] # a kernel
    """A number of the uniform distribution on [0, 1)."""
    return np.float64(hash_counter(key, counter) >> _MANTISSA_SHIFT) * _TO_UNIT


@njit(cache=True, nogil=True)
def normal_at(key, counter):  # type: ignore[no-untyped-def] # a kernel
    """A number of the standard normal distribution."""
    bits = hash_counter(key, counter)
    while True:
        layer = np.int64(bits & _LAYER_MASK)
        signed = 2.0 * np.float64(bits >> _MANTISSA_SHIFT) * _TO_UNIT - 1.0
        z = signed * _LAYER_X[layer]
        if abs(z) < _LAYER_X[layer + 1]:
            return z
        bits = hash_counter(bits, np.uint64(1))
        height = np.float64(bits >> _MANTISSA_SHIFT) * _TO_UNIT
        if layer == 0:
            bits = hash_counter(bits, np.uint64(1))
            other = np.float64(bits >> _MANTISSA_SHIFT) * _TO_UNIT
            beyond = -math.log(1.0 - height) / _TAIL
            if -2.0 * math.log(1.0 - other) > beyond * beyond:
                return _TAIL + beyond if signed > 0.0 else -_TAIL - beyond
        elif _LAYER_Y[layer] + height * (_LAYER_Y[layer + 1] - _LAYER_Y[layer]) < math.exp(-0.5 * z * z):
            return z
        bits = hash_counter(bits, np.uint64(2))


def _mixed(z: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    z = (z ^ (z >> _SHIFT_1)) * _MIX_1
    z = (z ^ (z >> _SHIFT_2)) * _MIX_2
    return np.asarray(z ^ (z >> _SHIFT_3))


def _ziggurat_layers() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """(257,) right ends of the layers, the widest (the base, whose area holds the tail) first, and their heights."""
    x = np.zeros(257)
    x[0], x[1] = _LAYER_AREA / math.exp(-0.5 * _TAIL * _TAIL), _TAIL
    for i in range(2, 256):
        x[i] = math.sqrt(-2.0 * math.log(_LAYER_AREA / x[i - 1] + math.exp(-0.5 * x[i - 1] ** 2)))
    return x, np.exp(-0.5 * x**2)


_LAYER_X, _LAYER_Y = _ziggurat_layers()
