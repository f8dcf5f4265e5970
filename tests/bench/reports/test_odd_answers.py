"""Answers that are odd but keep to the contract end in a report, and in one that says what is odd."""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict

import numpy as np
import pytest

from bench.cell import Cell, DatasetSpec, MethodKind, MethodSpec, Outcome
from bench.experiment import Experiment, write_experiment
from bench.scoring.result_reader import read_prediction
from bench.scoring.scores import score_result
from bench.scoring.yardstick import make_yardstick
from bench.settings import BenchSettings
from bench.stages import ScoredCell
from merger import se2
from sim.config import SimConfig
from sim.datasets.dataset import Dataset

LABEL = '<b>"x" & y</b>'


@pytest.fixture(scope="module")
def report_on(dataset: Dataset, tiny_config: SimConfig, tmp_path_factory) -> Callable[[dict], str]:
    """Scores a ``result.json`` and gives the report's page."""
    yardstick = make_yardstick(dataset)

    def report(document: dict, key: str = "noise", values: Sequence[object] = (0.1,)) -> str:
        out = tmp_path_factory.mktemp("odd")
        answer = out / "store" / "predictions" / "key" / "result.json"
        answer.parent.mkdir(parents=True)
        answer.write_text(json.dumps(document))
        with np.errstate(over="ignore", invalid="ignore"):
            found = score_result(yardstick, read_prediction(answer, dataset.truth.names), Outcome("ok"))
        score, maps, pairs = asdict(found[0]), [asdict(m) for m in found[1]], [asdict(p) for p in found[2]]
        method = MethodSpec(LABEL, MethodKind.EXTERNAL, "prog {maps} {out}")
        cells = [Cell(DatasetSpec("tiny", tiny_config, ((key, value),)), method, seed=0) for value in values]
        done = tuple(ScoredCell(cell, score, maps, pairs, dataset.path, answer) for cell in cells)
        write_experiment(Experiment("one", BenchSettings(), done, "command"), out)
        files = sorted(path.stem for path in (out / "figures").iterdir())
        assert files[::2] == files[1::2]  # each with its data
        return (out / "report.html").read_text(encoding="utf-8")

    return report


@pytest.fixture
def identity(dataset: Dataset, result_document) -> dict:
    """Every map placed where it is."""
    names = dataset.truth.names
    return result_document(names, np.tile(np.eye(3), (len(names), 1, 1)))


def test_maps_far_from_the_picture_are_counted_beside_it(report_on, identity) -> None:
    for k, entry in enumerate(identity["maps"].values()):
        entry["T_ref_map"]["x"] = 1e300 * (k > 0)
    page = report_on(identity)
    assert "(3 outside)" in page
    assert "1.00e+300" in page
    assert "0" * 100 not in page


def test_pieces_that_are_not_connected_are_counted(report_on, identity) -> None:
    for k, entry in enumerate(identity["maps"].values()):
        entry["component"] = k % 2
    assert "4 of 4 placed in 2 pieces" in report_on(identity)


def test_a_pair_whose_motion_leads_far_away_is_shown_in_the_frame_of_the_truth(report_on, identity) -> None:
    (first, second, *_) = identity["maps"]
    far = {"target": first, "source": second, "status": "reliable", "T_target_source": {"x": 1e6, "y": 0, "theta": 9}}
    page = report_on(identity | {"pairs": [far]})
    assert "refined (1 outside)" in page


@pytest.mark.parametrize("placed", [0, 1])
def test_where_no_two_maps_are_placed_together_there_is_nothing_to_measure(report_on, identity, placed: int) -> None:
    for k, entry in enumerate(identity["maps"].values()):
        entry |= {"placed": k < placed, "component": k, "confidence": 1.0}
    page = report_on(identity)
    assert re.search(r"\bnan\b", page, re.IGNORECASE) is None
    assert LABEL not in page
    assert f"{placed} of 4 placed, 0 wrong" in page


def test_motions_that_turn_more_than_once_are_as_good_as_others(report_on, dataset: Dataset, result_document) -> None:
    names = dataset.truth.names
    document = result_document(names, se2.invert(dataset.truth.T_world_map[0]) @ dataset.truth.T_world_map)
    for entry in document["maps"].values():
        entry["T_ref_map"]["theta"] += 20.0 * np.pi
    assert "4 of 4 placed, 0 wrong" in report_on(document)


@pytest.mark.parametrize(
    ("key", "values", "title", "text"),
    [
        ("noise", (0.1, 0.2), "Breaking points: noise", "Small values are taken to be the easy ones"),
        (
            "submaps.overlap",
            (0.1, 0.2),
            "Breaking points: submaps.overlap",
            "Large values are taken to be the easy ones",
        ),
        ("lidar", ("fast", None), "Success by lidar", "Words are in no order"),
    ],
)
def test_only_numbers_have_breaking_points(report_on, identity, *, key, values, title, text) -> None:
    for entry in identity["maps"].values():
        entry["placed"] = False
    page = report_on(identity, key, values)
    assert f"<h2>{title}</h2>" in page
    assert text in page
