"""A ``result.json`` is believed only when it is whole."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.scoring.result_document import MAX_BYTES, PredictionError
from bench.scoring.result_reader import read_prediction
from merger import se2

NAMES = ("map_00", "map_01")
MOTIONS = se2.make_motion([0.0, 1.0], [0.0, 2.0], [0.0, 0.5])


@pytest.fixture
def read(tmp_path: Path) -> Callable[[object], Any]:
    def write_and_read(document: object) -> Any:
        text = document if isinstance(document, str) else json.dumps(document)
        (tmp_path / "result.json").write_text(text)
        return read_prediction(tmp_path / "result.json", NAMES)

    return write_and_read


def test_schema_and_maps_suffice(read, result_document) -> None:
    prediction = read(result_document(NAMES, MOTIONS))
    np.testing.assert_allclose(prediction.T_ref_map, MOTIONS)
    assert prediction.placed.all()
    assert prediction.pairs == ()


def test_a_missing_file_is_said_plainly(tmp_path: Path) -> None:
    with pytest.raises(PredictionError, match=r"no result\.json was written"):
        read_prediction(tmp_path / "result.json", NAMES)


def _without(document: dict[str, Any], *path: str) -> dict[str, Any]:
    entry = document
    for key in path[:-1]:
        entry = entry[key]
    del entry[path[-1]]
    return document


def _with(document: dict[str, Any], value: object, *path: str) -> dict[str, Any]:
    entry = document
    for key in path[:-1]:
        entry = entry[key]
    entry[path[-1]] = value
    return document


@pytest.mark.parametrize(
    ("break_it", "reason"),
    [
        (lambda d: "{", "not JSON"),
        (lambda d: "[" * 100_000, "nested too deeply"),
        (lambda d: f'{{"schema": 1, "maps": {"9" * 5000}}}', "cannot be read"),
        (lambda d: json.dumps(d).replace('"maps"', '"schema": 1, "maps"'), "has the key 'schema' twice"),
        (lambda d: [], "not an object"),
        (lambda d: _with(d, True, "schema"), "schema must be 1"),
        (lambda d: _with(d, 2, "schema"), "schema must be 1"),
        (lambda d: _without(d, "maps", "map_01"), "partial: it leaves out map_01"),
        (lambda d: _with(d, {}, "maps", "map_09"), "not given: map_09"),
        (lambda d: _with(d, None, "maps", "map_00", "T_ref_map"), "placed but has no T_ref_map"),
        (lambda d: _with(d, "yes", "maps", "map_00", "placed"), "must be true or false"),
        (lambda d: _without(d, "maps", "map_00", "component"), "must be an integer"),
        (lambda d: _with(d, 2**70, "maps", "map_00", "component"), "must be an integer"),
        (lambda d: _with(d, -0.5, "maps", "map_00", "confidence"), r"within \[0, 1\], got -0.5"),
        (lambda d: _with(d, 10**400, "maps", "map_00", "T_ref_map", "x"), "finite number"),
        (lambda d: _with(d, {"x": 1.0, "y": 0.0}, "maps", "map_00", "T_ref_map"), "must be {x, y, theta}"),
        (lambda d: _with(d, {"x": "1", "y": 0, "theta": 0}, "maps", "map_00", "T_ref_map"), "finite number"),
        (lambda d: _with(d, [{"target": "map_00", "source": "z"}], "pairs"), "unknown map"),
        (lambda d: _with(d, [{"target": "map_00", "source": "map_01"}], "pairs"), "status of a pair"),
    ],
)
def test_what_is_malformed_or_partial_is_refused_with_its_reason(read, result_document, break_it, reason) -> None:
    with pytest.raises(PredictionError, match=reason):
        read(break_it(result_document(NAMES, MOTIONS)))


def test_a_reason_becomes_one_line_that_every_file_can_hold(read, result_document) -> None:
    said = "no\n match \x1b[31m\ud800 <b>"
    prediction = read(_with(result_document(NAMES, MOTIONS), said, "maps", "map_01", "reason"))
    assert prediction.reasons == (None, "no match <b>")


def test_a_name_that_fills_a_page_is_shortened_in_the_reason(read, result_document) -> None:
    with pytest.raises(PredictionError) as refused:
        read(_with(result_document(NAMES, MOTIONS), "x" * 10_000, "maps", "map_00", "placed"))
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda path: path.symlink_to("/dev/zero"), "no regular file"),
        (os.mkfifo, "no regular file"),
        (Path.mkdir, "no regular file"),
        (lambda path: path.write_bytes(b"\xff"), "UnicodeDecodeError"),
        (lambda path: os.truncate(path.open("w").name, MAX_BYTES + 1), "too large"),
    ],
)
def test_what_would_never_end_is_not_read(tmp_path: Path, make: Callable[[Path], None], reason: str) -> None:
    make(tmp_path / "result.json")
    with pytest.raises(PredictionError, match=reason):
        read_prediction(tmp_path / "result.json", NAMES)
