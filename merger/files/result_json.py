"""Merge results as the dictionary that ``result.json`` holds, and back."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from merger import se2
from merger.result import MapPlacement, MergeResult, Method, Objective, PairResult, PairStatus, Runtime

SCHEMA = 1
"""Version of the layout of ``result.json``."""

_Matrix = npt.NDArray[np.float64]


def to_json_dict(result: MergeResult) -> dict[str, Any]:
    """The dictionary that ``result.json`` holds; the merged grid is not part of it."""
    return {
        "schema": SCHEMA,
        "method": result.method.value,
        "seed": result.seed,
        "version": result.version,
        "reference": result.reference,
        "maps": {placement.name: _placement_to_json(placement) for placement in result.maps},
        "components": [list(names) for names in result.components],
        "pairs": [_pair_to_json(pair) for pair in result.pairs],
        "objective": asdict(result.objective),
        "runtime_s": asdict(result.runtime_s),
    }


def from_json_dict(document: Mapping[str, Any]) -> MergeResult:
    """The result that a ``result.json`` tells; ``schema`` and ``maps`` suffice, ``merged`` stays None.

    Of each map ``placed``, ``component`` and ``T_ref_map`` are needed, so that other programs' results can be read.

    Raises:
        ValueError: the document is not of schema 1, or a field is missing or of the wrong kind.
    """
    if not isinstance(document, Mapping) or document.get("schema") != SCHEMA:
        raise ValueError(f"result: field 'schema' must be {SCHEMA}")
    if not isinstance(document.get("maps"), Mapping) or not document["maps"]:
        raise ValueError("result: field 'maps' is missing or empty")
    maps = tuple(_placement_from_json(name, entry) for name, entry in sorted(document["maps"].items()))
    components = document.get("components")
    return MergeResult(
        method=Method(document.get("method", Method.PAPER)),
        seed=int(document.get("seed", 0)),
        version=str(document.get("version", "")),
        reference=str(document.get("reference", maps[0].name)),
        maps=maps,
        components=_components_of(maps) if components is None else tuple(tuple(names) for names in components),
        pairs=tuple(_pair_from_json(entry) for entry in document.get("pairs", [])),
        objective=Objective(**_known(document.get("objective", {}), Objective)),
        runtime_s=Runtime(**_known(document.get("runtime_s", {}), Runtime)),
    )


def motion_to_json(T: _Matrix | None) -> dict[str, float] | None:
    """A (3, 3) motion as ``{"x": m, "y": m, "theta": rad}``, theta in (-pi, pi]."""
    if T is None:
        return None
    x, y, theta = (float(v) for v in se2.parameters_of(T))
    return {"x": x, "y": y, "theta": theta}


def motion_from_json(value: Mapping[str, float] | None) -> _Matrix | None:
    """The inverse of `motion_to_json`.

    Raises:
        ValueError: a field is missing or not a finite number.
    """
    if value is None:
        return None
    try:
        numbers = [float(value[key]) for key in ("x", "y", "theta")]
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"result: a motion needs numbers x, y and theta, got {value}") from None
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"result: a motion must be finite, got {value}")
    return se2.make_motion(*numbers)


def _placement_to_json(placement: MapPlacement) -> dict[str, Any]:
    return {
        "placed": placement.placed,
        "component": placement.component,
        "T_ref_map": motion_to_json(placement.T_ref_map),
        "T_ref_map_initial": motion_to_json(placement.T_ref_map_initial),
        "confidence": placement.confidence,
        "covariance": _matrix_to_json(placement.covariance),
        "reason": placement.reason,
        "scale": placement.scale,
    }


def _placement_from_json(name: str, entry: Mapping[str, Any]) -> MapPlacement:
    if not isinstance(entry, Mapping) or not isinstance(entry.get("placed"), bool):
        raise ValueError(f"result: map '{name}' needs the field 'placed', true or false")
    T_ref_map = motion_from_json(entry.get("T_ref_map"))
    if entry["placed"] and T_ref_map is None:
        raise ValueError(f"result: map '{name}' is placed but has no 'T_ref_map'")
    component = entry.get("component", 0)
    if not isinstance(component, int):
        raise ValueError(f"result: map '{name}': 'component' must be an integer, got {component}")
    return MapPlacement(
        name=name,
        placed=entry["placed"],
        component=component,
        T_ref_map=T_ref_map,
        T_ref_map_initial=motion_from_json(entry.get("T_ref_map_initial")),
        confidence=entry.get("confidence"),
        covariance=_matrix_from_json(entry.get("covariance")),
        reason=entry.get("reason"),
        scale=entry.get("scale"),
    )


def _pair_to_json(pair: PairResult) -> dict[str, Any]:
    return {
        "target": pair.target,
        "source": pair.source,
        "status": pair.status.value,
        "reason": pair.reason,
        "T_target_source": motion_to_json(pair.T_target_source),
        "num_matches": pair.num_matches,
        "num_inliers": pair.num_inliers,
        "overlap": pair.overlap,
        "rmse_m": pair.rmse_m,
        "agreement": pair.agreement,
        "confidence": pair.confidence,
        "T_target_source_initial": motion_to_json(pair.T_target_source_initial),
        "information": _matrix_to_json(pair.information),
        "in_tree": pair.in_tree,
    }


def _pair_from_json(entry: Mapping[str, Any]) -> PairResult:
    plain = ("reason", "num_matches", "num_inliers", "overlap", "rmse_m", "agreement", "confidence")
    try:
        return PairResult(
            target=str(entry["target"]),
            source=str(entry["source"]),
            status=PairStatus(entry["status"]),
            T_target_source=motion_from_json(entry.get("T_target_source")),
            T_target_source_initial=motion_from_json(entry.get("T_target_source_initial")),
            information=_matrix_from_json(entry.get("information")),
            in_tree=bool(entry.get("in_tree", False)),
            **{key: entry.get(key) for key in plain},
        )
    except KeyError as error:
        raise ValueError(f"result: a pair lacks the field {error}") from None


def _components_of(maps: tuple[MapPlacement, ...]) -> tuple[tuple[str, ...], ...]:
    indices = sorted({placement.component for placement in maps})
    groups = [tuple(placement.name for placement in maps if placement.component == index) for index in indices]
    return tuple(groups)


def _known(document: Mapping[str, Any], record: type[Objective] | type[Runtime]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key in record.__dataclass_fields__}


def _matrix_to_json(matrix: _Matrix | None) -> list[list[float]] | None:
    return None if matrix is None else [[float(value) for value in row] for row in matrix]


def _matrix_from_json(rows: list[list[float]] | None) -> _Matrix | None:
    return None if rows is None else np.asarray(rows, dtype=np.float64)
