"""The fit of the pair probability, by its laws."""

from dataclasses import replace

import numpy as np
import pytest

from bench.pair_calibration import (
    describe_fit,
    describe_recall,
    fit_coefficients,
    fit_steps,
    hold_out,
    hold_out_steps,
    main,
)
from bench.pair_samples import Samples, collect_samples
from merger.robust.pair_probability import FEATURES, ProbabilityConfig

TRUE = np.array([-2.0, -2.0, -1.0, -0.5, 1.0, -1.0, -1.0, 1.0])


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


def samples_of(features: np.ndarray, right: np.ndarray) -> Samples:
    number = np.arange(len(right))
    overlap = np.where(right, 0.25, 0.0)
    steps = np.array([3.0, 6.0, -0.5]), np.array([1, 1, 0]) > 0, np.array([0, 1, 0])
    return Samples(features, right, number % 3 > 0, number % 2, number, overlap, *steps)


def test_motions_that_lose_to_another_of_their_pair_teach_nothing():
    samples = samples_of(*draw(500, np.random.default_rng(4)))
    other = replace(samples, right=samples.right ^ ~samples.is_best)
    assert hold_out(other) == pytest.approx(hold_out(samples))


def test_the_text_names_every_feature_and_building():
    features, right = draw(500, np.random.default_rng(2))
    text = describe_fit(samples_of(features, right), ["east", "west"])
    for word in (*FEATURES, "east", "west", "2 right (0 below 2", "1 wrong, the most probable: -0.50"):
        assert word in text


def test_the_fit_is_calibrated_on_a_building_that_it_has_not_seen():
    features, right = draw(20_000, np.random.default_rng(3))
    held = hold_out(samples_of(features, right))
    for low in (-1.0, 0.5, 2.0):
        inside = (held >= low) & (held < low + 1.0)
        assert right[inside].mean() == pytest.approx((1.0 / (1.0 + np.exp(-held[inside]))).mean(), abs=0.05)


def test_the_fit_of_steps_finds_the_model_that_made_them_on_buildings_that_it_has_not_seen():
    rng = np.random.default_rng(4)
    motion_log_odds = rng.uniform(-3.0, 4.0, 20_000)
    log_odds = 0.6 + 1.6 * motion_log_odds
    right = rng.random(20_000) < 1.0 / (1.0 + np.exp(-log_odds))
    assert fit_steps(motion_log_odds, right) == pytest.approx([0.6, 1.6], abs=0.1)
    samples = samples_of(np.zeros((2, 6)), np.array([True, False]))
    samples = replace(samples, step_log_odds=motion_log_odds, step_right=right, step_building=np.arange(20_000) % 3)
    assert np.abs(hold_out_steps(samples) - log_odds).max() < 0.5


def test_recall_is_counted_above_one_false_accept_in_a_thousand():
    log_odds = np.concatenate([np.arange(1000.0), [998.5, 999.5, 997.0, 5000.0]])
    right = np.arange(1004) >= 1000
    samples = replace(samples_of(np.zeros((1004, 6)), right), overlap=np.where(right, 0.4, 0.0))
    assert "above log-odds of 998.00, by overlap from 0.1 nan" in describe_recall(log_odds, samples)
    assert "0.3 0.750" in describe_recall(log_odds, samples)


def test_samples_of_a_dataset_tell_right_motions_from_wrong_ones(dataset):
    samples, names = collect_samples([dataset.path])
    assert len(names) == 1
    assert samples.right.any()
    assert not samples.right.all()
    in_use = samples.features @ np.array(ProbabilityConfig().coefficients)
    assert in_use[samples.right].mean() > in_use[~samples.right].mean() + 3.0
    assert samples.step_right.all()


def test_a_folder_that_is_no_dataset_is_one_line_and_status_2(tmp_path, capsys):
    assert main([str(tmp_path / "missing")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
