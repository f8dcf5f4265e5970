"""A finished cell brought back from disk for its pictures: maps, truth, the answer and its errors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.reports.tables import format_swept
from bench.scoring import metrics
from bench.scoring.prediction import Prediction
from bench.scoring.result_document import PredictionError
from bench.scoring.result_reader import read_prediction
from bench.stages import ScoredCell
from sim.datasets.dataset import Dataset, read_dataset


@dataclass(frozen=True)
class Exhibit:
    """What a picture of one result needs."""

    scored: ScoredCell
    """The cell."""
    dataset: Dataset
    """Maps and truth."""
    prediction: Prediction
    """The answer."""
    errors: metrics.PlacementErrors
    """Its errors, and the frame of each map's component."""

    @property
    def label(self) -> str:
        """Name of the dataset in the tables, and the swept values that made it."""
        spec = self.scored.cell.dataset
        return ", ".join([spec.label, *(f"{key}={format_swept(value)}" for key, value in spec.swept)])

    @property
    def method(self) -> str:
        """Name of the method in the tables."""
        return self.scored.cell.method.label

    @property
    def T_world_map(self) -> npt.NDArray[np.float64]:
        """(N, 3, 3) fine poses in ``world``; NaN where a map has none."""
        return np.asarray(self.errors.T_world_ref @ self.prediction.T_ref_map)

    @property
    def T_world_map_initial(self) -> npt.NDArray[np.float64]:
        """(N, 3, 3) coarse poses in ``world``, each component in the frame that fits its coarse motions."""
        p = self.prediction
        known = p.placed & np.isfinite(p.T_ref_map_initial).all(axis=(1, 2))
        initial = metrics.placement_errors(self.dataset.truth.T_world_map, known, p.component, p.T_ref_map_initial)
        return np.asarray(initial.T_world_ref @ p.T_ref_map_initial)


def load_exhibit(scored: ScoredCell) -> Exhibit | None:
    """Load a cell's answer; none where the method gave none that can be read."""
    if scored.score["status"] != "ok":
        return None
    try:
        dataset = read_dataset(scored.dataset)
        prediction = read_prediction(scored.result, dataset.truth.names)
    except (PredictionError, ValueError):
        return None
    errors = metrics.placement_errors(
        dataset.truth.T_world_map, prediction.placed, prediction.component, prediction.T_ref_map
    )
    return Exhibit(scored, dataset, prediction, errors)


def first_of_each(cells: Sequence[ScoredCell]) -> list[ScoredCell]:
    """The first cell of every dataset, swept point and method."""
    seen: dict[tuple[object, ...], ScoredCell] = {}
    for scored in cells:
        cell = scored.cell
        seen.setdefault((cell.dataset.label, cell.dataset.swept, cell.method.label), scored)
    return list(seen.values())
