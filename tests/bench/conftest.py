"""A small office as a CARMEN log, its dataset, and answers to score: what the tests of the bench share."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.scoring.prediction import PredictedPair, Prediction
from merger import se2
from sim.config import SimConfig, SourceConfig, SourceKind
from sim.datasets.dataset import Dataset, make_dataset, read_dataset
from sim.maps.submap_mapping import MappingConfig, PoseSource
from sim.maps.submaps import SubmapsConfig

NUM_BEAMS = 180


@pytest.fixture(scope="session")
def log_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one log, ``tiny.log``: a loop through four furnished rooms of 12 m x 9 m."""
    folder = tmp_path_factory.mktemp("logs")
    segments = _walls()
    lines = [_flaser(segments, pose, k) for k, pose in enumerate(_loop())]
    (folder / "tiny.log").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="session")
def tiny_config(log_folder: Path) -> SimConfig:
    """The log in four parts."""
    return SimConfig(
        source=SourceConfig(SourceKind.CARMEN, str(log_folder / "tiny.log")),
        submaps=SubmapsConfig(count=4, overlap=0.4),
        mapping=MappingConfig(poses=PoseSource.TRUTH),
    )


@pytest.fixture(scope="session")
def dataset(tiny_config: SimConfig, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """The dataset of `tiny_config`."""
    return read_dataset(make_dataset(tiny_config, tmp_path_factory.mktemp("dataset") / "tiny"))


@pytest.fixture
def answer() -> Callable[..., Prediction]:
    """Makes a prediction from motions, all placed in one component unless said otherwise."""

    def make(T_ref_map: np.ndarray, **changes: Any) -> Prediction:
        count = len(T_ref_map)
        fields: dict[str, Any] = {
            "names": tuple(f"map_{k:02d}" for k in range(count)),
            "placed": np.ones(count, dtype=bool),
            "component": np.zeros(count, dtype=np.int64),
            "T_ref_map": T_ref_map,
            "T_ref_map_initial": T_ref_map,
            "confidence": np.full(count, np.nan),
            "reasons": (None,) * count,
            "pairs": (),
            "stages_s": {},
        }
        return Prediction(**(fields | changes))

    return make


@pytest.fixture
def pair() -> Callable[..., PredictedPair]:
    """Makes a pair with a motion."""

    def make(target: int, source: int, T: np.ndarray | None, status: str = "reliable") -> PredictedPair:
        return PredictedPair(target, source, status, None, T, np.nan, np.nan, np.nan)

    return make


@pytest.fixture
def result_document() -> Callable[..., dict[str, Any]]:
    """Makes the smallest valid ``result.json`` for these motions."""

    def make(names: tuple[str, ...], T_ref_map: np.ndarray) -> dict[str, Any]:
        motions = [dict(zip(("x", "y", "theta"), map(float, se2.parameters_of(T)), strict=True)) for T in T_ref_map]
        entries = [{"placed": True, "component": 0, "T_ref_map": motion} for motion in motions]
        document = {"schema": 1, "maps": dict(zip(names, entries, strict=True))}
        return dict(json.loads(json.dumps(document)))

    return make


def _walls() -> np.ndarray:
    """(N, 2, 2) segments: an outline, two walls with doors, and furniture that is nowhere the same."""
    boxes = [
        (0.0, 0.0, 12.0, 9.0),
        (0.6, 0.5, 0.9, 0.6),
        (7.0, 0.4, 1.6, 0.5),
        (10.6, 6.6, 0.8, 1.7),
        (1.2, 7.4, 1.9, 0.7),
    ]
    boxes += [
        (4.6, 3.6, 0.7, 1.1),
        (8.2, 4.4, 1.3, 0.9),
        (3.1, 0.3, 0.4, 0.4),
        (5.2, 8.0, 0.6, 0.6),
        (9.3, 2.2, 0.5, 0.3),
    ]
    segments = [side for box in boxes for side in _box(*box)]
    segments += [((6.0, 0.0), (6.0, 1.8)), ((6.0, 3.0), (6.0, 6.2)), ((6.0, 7.4), (6.0, 9.0))]
    segments += [
        ((0.0, 4.9), (1.6, 4.9)),
        ((2.8, 4.9), (6.0, 4.9)),
        ((6.0, 4.1), (9.7, 4.1)),
        ((10.9, 4.1), (12.0, 4.1)),
    ]
    return np.array(segments)


def _box(x: float, y: float, width: float, height: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def _loop() -> list[tuple[float, float, float]]:
    """Poses along a loop through the rooms, about 0.4 m apart, one and a half times round."""
    stops = [
        (2.2, 2.5),
        (6.0, 2.4),
        (9.0, 2.0),
        (10.3, 4.1),
        (10.0, 5.9),
        (6.0, 6.8),
        (3.5, 6.6),
        (2.2, 4.9),
        (2.2, 2.5),
    ]
    stops += stops[1:6]
    poses: list[tuple[float, float, float]] = []
    for (x0, y0), (x1, y1) in itertools.pairwise(stops):
        heading = np.arctan2(y1 - y0, x1 - x0)
        steps = max(int(np.hypot(x1 - x0, y1 - y0) / 0.4), 1)
        poses += [(x0 + (x1 - x0) * s / steps, y0 + (y1 - y0) * s / steps, heading) for s in range(steps)]
    return poses


def _flaser(segments: np.ndarray, pose: tuple[float, float, float], stamp: int) -> str:
    x, y, theta = pose
    angles = theta - np.pi / 2 + np.deg2rad(np.arange(NUM_BEAMS))
    ranges = _cast(segments, np.array([x, y]), np.stack([np.cos(angles), np.sin(angles)], axis=1))
    where = f"{x:.5f} {y:.5f} {theta:.6f}"
    return f"FLASER {NUM_BEAMS} {' '.join(f'{r:.3f}' for r in ranges)} {where} {where} {stamp}.0 host {stamp}.0"


def _cast(segments: np.ndarray, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Ranges by brute force."""
    a, along = segments[:, 0] - origin, segments[:, 1] - segments[:, 0]
    cross = directions[:, None, 0] * along[None, :, 1] - directions[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (a[None, :, 0] * along[None, :, 1] - a[None, :, 1] * along[None, :, 0]) / cross
        u = (a[None, :, 0] * directions[:, None, 1] - a[None, :, 1] * directions[:, None, 0]) / cross
    hit = (t > 0) & (u >= 0) & (u <= 1)
    return np.where(hit, t, 81.83).min(axis=1)
