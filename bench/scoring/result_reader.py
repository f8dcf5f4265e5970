"""Reading a method's ``result.json``: only what is scored, checked before it is believed.

Every method comes through this door, ours and other people's: a result that is malformed or leaves maps out is refused
with a reason that becomes a row of the table.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.one_line import one_line
from bench.scoring.prediction import PredictedPair, Prediction
from bench.scoring.result_document import PredictionError, read_document, show
from merger import se2

_STATUSES = ("reliable", "rejected", "no_match")
_LARGEST = 2**63 - 1
_NO_MOTION = (math.nan, math.nan, math.nan)

_Motion = npt.NDArray[np.float64]
_Parameters = tuple[float, float, float]
"""Of a motion: metres, metres, radians."""


def read_prediction(path: Path, names: Sequence[str]) -> Prediction:
    """Read and check a ``result.json``.

    Args:
        path: The file.
        names: Names of the dataset's maps; the answer comes in this order.

    Raises:
        PredictionError: the file is missing, no JSON, malformed, or does not speak of exactly these maps.
    """
    document = read_document(path)
    maps = _mapping(document, "maps")
    missing, unknown = sorted(set(names) - set(maps)), sorted(set(maps) - set(names))
    if missing:
        raise PredictionError(f"result.json is partial: it leaves out {_names(missing)}")
    if unknown:
        raise PredictionError(f"result.json speaks of maps that were not given: {_names(unknown)}")
    entries = [_mapping(maps, name) for name in names]
    placed = np.array([_boolean(e, "placed", n) for e, n in zip(entries, names, strict=True)], dtype=bool)
    motions = [_motion(e, "T_ref_map", n) for e, n in zip(entries, names, strict=True)]
    for name, is_placed, motion in zip(names, placed, motions, strict=True):
        if is_placed and motion is None:
            raise PredictionError(f"result.json: map '{name}' is placed but has no T_ref_map")
    initial = [_motion(e, "T_ref_map_initial", n) for e, n in zip(entries, names, strict=True)]
    return Prediction(
        names=tuple(names),
        placed=placed,
        component=np.array([_integer(e, "component", n) for e, n in zip(entries, names, strict=True)], dtype=np.int64),
        T_ref_map=_stack([m if p else None for m, p in zip(motions, placed, strict=True)]),
        T_ref_map_initial=_stack(initial),
        confidence=np.array([_confidence(e, n) for e, n in zip(entries, names, strict=True)]),
        reasons=tuple(_reason(e) for e in entries),
        pairs=_pairs(_list(document, "pairs"), {name: k for k, name in enumerate(names)}),
        stages_s={k: _number(v, k) for k, v in _optional_mapping(document, "runtime_s").items()},
    )


def _mapping(document: dict[str, Any], key: str) -> dict[str, Any]:
    value = document.get(key)
    if not isinstance(value, dict):
        raise PredictionError(f"result.json: '{key}' is missing or not an object")
    return value


def _optional_mapping(document: dict[str, Any], key: str) -> dict[str, Any]:
    return _mapping(document, key) if document.get(key) is not None else {}


def _list(document: dict[str, Any], key: str) -> list[Any]:
    value = document.get(key) or []
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise PredictionError(f"result.json: '{key}' is not a list of objects")
    return value


def _boolean(entry: dict[str, Any], key: str, name: str) -> bool:
    value = entry.get(key)
    if not isinstance(value, bool):
        raise PredictionError(f"result.json: '{key}' of map '{name}' must be true or false, got {show(value)}")
    return value


def _integer(entry: dict[str, Any], key: str, name: str) -> int:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) > _LARGEST:
        raise PredictionError(f"result.json: '{key}' of map '{name}' must be an integer of 63 bits, got {show(value)}")
    return value


def _number(value: object, key: str) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        raise PredictionError(f"result.json: '{key}' must be a finite number, got {show(value)}")
    return float(value)


def _confidence(entry: dict[str, Any], name: str) -> float:
    value = _number(entry.get("confidence"), "confidence")
    if not (math.isnan(value) or 0.0 <= value <= 1.0):
        raise PredictionError(f"result.json: 'confidence' of map '{name}' must be within [0, 1], got {value:g}")
    return value


def _reason(entry: dict[str, Any]) -> str | None:
    value = entry.get("reason")
    return None if value is None else one_line(str(value))


def _names(names: Sequence[str]) -> str:
    return one_line(", ".join(names), 300)


def _motion(entry: dict[str, Any], key: str, name: str) -> _Parameters | None:
    value = entry.get(key)
    if value is None:
        return None
    if not isinstance(value, dict) or any(value.get(k) is None for k in ("x", "y", "theta")):
        raise PredictionError(f"result.json: '{key}' of '{name}' must be {{x, y, theta}}, got {show(value)}")
    x, y, theta = (_number(value[k], f"{key}.{k}") for k in ("x", "y", "theta"))
    return x, y, theta


def _stack(motions: Sequence[_Parameters | None]) -> npt.NDArray[np.float64]:
    """(N, 3, 3) motions; NaN where there is none."""
    parameters = np.array([_NO_MOTION if motion is None else motion for motion in motions]).reshape(-1, 3)
    stack = se2.make_motion(*parameters.T)
    stack[np.isnan(parameters[:, 0])] = np.nan
    return stack


def _pairs(entries: Sequence[dict[str, Any]], numbers: dict[str, int]) -> tuple[PredictedPair, ...]:
    """What is said about pairs; ``numbers`` are those of the maps, by name."""
    labels = [f"{entry.get('target')}-{entry.get('source')}" for entry in entries]
    columns = []
    for key in ("T_target_source", "T_target_source_initial"):
        motions = [_motion(entry, key, label) for entry, label in zip(entries, labels, strict=True)]
        columns.append([None if m is None else T for m, T in zip(motions, _stack(motions), strict=True)])
    return tuple(_pair(entry, numbers, *motions) for entry, *motions in zip(entries, *columns, strict=True))


def _pair(
    entry: dict[str, Any], numbers: dict[str, int], T: _Motion | None, T_initial: _Motion | None
) -> PredictedPair:
    target, source = entry.get("target"), entry.get("source")
    if not (isinstance(target, str) and isinstance(source, str) and {target, source} <= numbers.keys()):
        raise PredictionError(f"result.json: a pair names an unknown map: {show(target)}, {show(source)}")
    status = entry.get("status")
    if status not in _STATUSES:
        raise PredictionError(
            f"result.json: the status of a pair must be one of {', '.join(_STATUSES)}, got {show(status)}"
        )
    return PredictedPair(
        target=numbers[target],
        source=numbers[source],
        status=str(status),
        reason=_reason(entry),
        T_target_source=T,
        num_matches=_number(entry.get("num_matches"), "num_matches"),
        num_inliers=_number(entry.get("num_inliers"), "num_inliers"),
        agreement=_number(entry.get("agreement"), "agreement"),
        T_target_source_initial=T_initial,
        in_tree=bool(entry.get("in_tree", False)),
    )
