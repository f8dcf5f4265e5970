"""Fields of a YAML document, read with their types checked; every fault is a ValueError that says where."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt


def check_fields(where: str, item: Any, fields: set[str]) -> None:
    """Refuse what is no mapping, and fields that are not known."""
    if not isinstance(item, dict):
        raise ValueError(f"{where} must be a mapping, got '{item}'")
    unknown = sorted(set(map(str, item)) - fields)
    if unknown:
        raise ValueError(f"{where} has an unknown field '{unknown[0]}'; known are {', '.join(sorted(fields))}")


def read_list(document: dict[str, Any], key: str) -> list[Any]:
    """The list in a field; empty if the field is not there."""
    value = document.get(key, [])
    if not isinstance(value, list):
        raise ValueError(f"field '{key}' must be a list")
    return value


def read_numbers(where: str, value: Any, count: int) -> list[float]:
    """So many finite numbers."""
    numbers = value if isinstance(value, list) else []
    ok = len(numbers) == count and all(isinstance(v, int | float) and not isinstance(v, bool) for v in numbers)
    if not ok or not all(math.isfinite(v) for v in numbers):
        raise ValueError(f"{where} must be {count} finite number{'s' if count > 1 else ''}, got '{value}'")
    return [float(v) for v in numbers]


def read_points(where: str, value: Any) -> npt.NDArray[np.float64]:
    """(M, 2) points, M >= 2."""
    if not isinstance(value, list) or len(value) < 2:
        raise ValueError(f"{where} must be a list of at least two points [x, y], got '{value}'")
    return np.array([read_numbers(f"{where}[{k}]", point, 2) for k, point in enumerate(value)])


def read_positive(where: str, value: Any) -> float:
    """A number above zero."""
    number = read_numbers(where, [value], 1)[0]
    if number <= 0.0:
        raise ValueError(f"{where} must be > 0, got {number:g}")
    return number


def read_seed(value: Any) -> int:
    """A whole number, at least zero."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"seed must be a whole number >= 0, got '{value}'")
    return value
