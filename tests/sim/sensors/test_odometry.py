"""Odometry: exact without noise, drifting with it, and by as much however often it is read."""

import math

import numpy as np
import numpy.typing as npt
import pytest

from merger import se2
from sim.sensors.odometry import OdometryConfig, integrate_odometry

PERFECT = OdometryConfig(alpha1=0.0, alpha2=0.0, alpha3=0.0, alpha4=0.0)


def winding_path(num_poses: int) -> npt.NDArray[np.float64]:
    """A path of 60 m with turns to both sides, from (3, -2)."""
    s = np.linspace(0.0, 60.0, num_poses)
    heading = 1.2 * np.sin(s / 4.0)
    step = 60.0 / (num_poses - 1)
    x = 3.0 + np.concatenate([[0.0], np.cumsum(step * np.cos(heading[:-1]))])
    y = -2.0 + np.concatenate([[0.0], np.cumsum(step * np.sin(heading[:-1]))])
    return se2.make_motion(x, y, heading)


def final_errors(config: OdometryConfig, path: npt.NDArray[np.float64], num_runs: int = 60) -> npt.NDArray[np.float64]:
    """(R, 3) error of the last pose of each run: x, y, angle."""
    truth = se2.invert(path[0]) @ path[-1]
    ends = [integrate_odometry(path, config, np.random.default_rng(k))[-1] for k in range(num_runs)]
    return se2.parameters_of(se2.invert(truth) @ np.stack(ends))


def test_without_noise_odometry_is_the_truth_seen_from_the_first_pose() -> None:
    path = winding_path(400)
    told = integrate_odometry(path, PERFECT, np.random.default_rng(0))
    np.testing.assert_allclose(told, se2.invert(path[0]) @ path, atol=1e-10)


def test_the_same_stream_gives_the_same_odometry() -> None:
    path = winding_path(100)
    a, b = (integrate_odometry(path, OdometryConfig(), np.random.default_rng(5)) for _ in range(2))
    assert a.tobytes() == b.tobytes()


def test_drift_grows_along_the_way() -> None:
    path = winding_path(601)
    quarters = [np.hypot(*final_errors(OdometryConfig(), path[: 150 * k + 1]).T[:2]).mean() for k in (1, 2, 4)]
    assert quarters[0] < quarters[1] < quarters[2]


def test_drift_does_not_depend_on_how_often_it_is_read() -> None:
    config = OdometryConfig(alpha1=0.0, alpha4=0.0)
    coarse, fine = (final_errors(config, winding_path(n), 200) for n in (121, 1201))
    assert coarse[:, 2].std() == pytest.approx(fine[:, 2].std(), rel=0.25)


def test_at_its_own_step_the_model_is_that_of_the_book() -> None:
    config = OdometryConfig(alpha1=0.0, alpha2=0.0, alpha3=0.04, alpha4=0.0, step_m=0.5)
    path = se2.make_motion(np.array([0.0, 0.5]), 0.0, 0.0)
    assert final_errors(config, path, 2000)[:, 0].std() == pytest.approx(math.sqrt(0.04) * 0.5, rel=0.06)


def test_a_turn_on_the_spot_stays_on_the_spot_but_for_alpha4() -> None:
    path = se2.make_motion(np.zeros(50), 0.0, np.linspace(0.0, 3.0, 50))
    assert np.abs(final_errors(OdometryConfig(alpha4=0.0), path)[:, :2]).max() < 1e-9
    assert np.abs(final_errors(OdometryConfig(alpha4=0.5), path)[:, :2]).max() > 1e-3


def test_driving_backwards_is_no_half_turn() -> None:
    path = se2.make_motion(-np.linspace(0.0, 5.0, 100), 0.0, 0.0)
    assert np.abs(final_errors(OdometryConfig(), path)[:, 2]).max() < 1.5


def test_a_larger_right_wheel_told_bends_the_path_to_the_left() -> None:
    config = OdometryConfig(alpha1=0, alpha2=0, alpha3=0, alpha4=0, right_wheel_scale=1.01, wheel_base_m=0.4)
    path = se2.make_motion(np.linspace(0.0, 10.0, 200), 0.0, 0.0)
    told = se2.parameters_of(integrate_odometry(path, config, np.random.default_rng(0))[-1])
    assert told[2] == pytest.approx(10.0 * 0.01 / 0.4)


@pytest.mark.parametrize(
    ("field", "value"), [("alpha1", -0.1), ("alpha4", math.nan), ("step_m", 0.0), ("left_wheel_scale", 3.0)]
)
def test_impossible_wheels_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        OdometryConfig(**{field: value})
