"""A yardstick from its file measures exactly as the one that was worked out."""

import dataclasses

import numpy as np

from bench.cell import Outcome
from bench.scoring.scores import score_result
from bench.scoring.yardstick import make_yardstick
from bench.scoring.yardstick_file import encode_yardstick, read_yardstick
from merger import se2


def test_a_yardstick_comes_back_from_its_file_to_the_last_bit(dataset, answer, tmp_path):
    made, path = make_yardstick(dataset), tmp_path / "yardstick.bin"
    path.write_bytes(encode_yardstick(made))
    read = read_yardstick(path, dataset.truth)
    shifted = dataset.truth.T_world_map @ se2.make_motion(0.1, -0.2, 0.03)
    for motions in (dataset.truth.T_world_map, shifted):
        prediction = dataclasses.replace(answer(motions), T_ref_map_initial=dataset.truth.T_world_map)
        scores = [score_result(yardstick, prediction, Outcome("ok"))[0] for yardstick in (made, read)]
        assert repr(scores[0]) == repr(scores[1])
    for old, new in zip(made.grid.sheets, read.grid.sheets, strict=True):
        np.testing.assert_array_equal(old.marks, new.marks)
    assert read.objective_floor == made.objective_floor


def test_a_file_that_is_missing_cut_off_or_something_else_is_no_yardstick(dataset, tmp_path):
    whole = encode_yardstick(make_yardstick(dataset))
    for k, content in enumerate([whole[: len(whole) // 2], b"", bytes(64), whole + b"x"]):
        (tmp_path / f"{k}.bin").write_bytes(content)
        assert read_yardstick(tmp_path / f"{k}.bin", dataset.truth) is None
    assert read_yardstick(tmp_path / "nothing.bin", dataset.truth) is None
