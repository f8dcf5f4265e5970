"""The fit of the pair probability, by its laws."""

import numpy as np
import pytest

from bench.pair_calibration import Samples, describe_fit, fit_coefficients, main
from merger.pair_probability import FEATURES

TRUE = np.array([-2.0, -2.0, -1.0, -0.5, 1.0, -1.0])


def draw(num: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    features = np.column_stack([np.ones(num), rng.normal(size=(num, len(FEATURES) - 1))])
    return features, rng.random(num) < 1.0 / (1.0 + np.exp(-features @ TRUE))


def test_the_fit_finds_the_model_that_made_the_samples():
    features, right = draw(20_000, np.random.default_rng(0))
    assert fit_coefficients(features, right) == pytest.approx(TRUE, abs=0.15)


def test_a_feature_of_the_wrong_sign_gets_no_weight():
    features, right = draw(5_000, np.random.default_rng(1))
    features[:, 1] *= -1.0
    assert fit_coefficients(features, right)[1] == 0.0


def test_the_text_names_every_feature_and_dataset():
    features, right = draw(500, np.random.default_rng(2))
    text = describe_fit(Samples(features, right, np.arange(500) % 2), ["east", "west"])
    for word in (*FEATURES, "east", "west"):
        assert word in text


def test_a_folder_that_is_no_dataset_is_one_line_and_status_2(tmp_path, capsys):
    assert main([str(tmp_path / "missing")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
