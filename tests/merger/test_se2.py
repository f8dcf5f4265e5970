import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merger import se2

_lengths = st.floats(-50.0, 50.0)
_angles = st.one_of(
    st.floats(-np.pi, np.pi),
    st.floats(-1e-7, 1e-7),
    st.floats(np.pi - 1e-7, np.pi),
    st.floats(-np.pi, -np.pi + 1e-7),
    st.sampled_from([0.0, np.pi, -np.pi, np.pi / 2, 1e-6, -1e-6]),
)
_tangents = st.tuples(_lengths, _lengths, _angles).map(np.array)
_motions = st.tuples(_lengths, _lengths, _angles).map(lambda p: se2.make_motion(*p))


@given(_tangents)
def test_log_undoes_exp_up_to_a_full_turn(v):
    again = se2.log(se2.exp(v))
    assert np.allclose(se2.exp(again), se2.exp(v), atol=1e-9)
    if abs(v[2]) < np.pi - 1e-6:
        assert np.allclose(again, v, atol=1e-8)


@given(_motions)
def test_exp_undoes_log_near_zero_and_at_a_half_turn_too(T):
    assert np.allclose(se2.exp(se2.log(T)), T, atol=1e-9)


@given(_motions)
def test_the_angle_of_a_logarithm_lies_in_the_half_open_turn(T):
    angle = se2.log(T)[2]
    assert -np.pi < angle <= np.pi


@given(_motions, _motions)
def test_a_motion_times_its_inverse_is_the_identity(T, U):
    assert np.allclose(T @ se2.invert(T), np.eye(3), atol=1e-9)
    assert np.allclose(se2.invert(T @ U), se2.invert(U) @ se2.invert(T), atol=1e-9)


@given(_motions, _motions)
def test_points_go_through_a_chain_of_motions_as_through_their_product(T, U):
    points = np.array([[0.0, 0.0], [1.0, -2.0], [30.0, 4.0]])
    one_by_one = se2.transform_points(T, se2.transform_points(U, points))
    assert np.allclose(se2.transform_points(T @ U, points), one_by_one, atol=1e-9)


@given(_motions, _tangents)
def test_the_adjoint_moves_a_tangent_through_a_motion(T, v):
    left = T @ se2.exp(v) @ se2.invert(T)
    assert np.allclose(left, se2.exp(se2.adjoint(T) @ v), atol=1e-7)


@given(_motions)
def test_parameters_and_motions_are_inverse_to_each_other(T):
    assert np.allclose(se2.make_motion(*se2.parameters_of(T)), T, atol=1e-12)


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_lie_in_the_half_open_turn_and_differ_by_whole_turns(angle):
    wrapped = float(se2.wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.isclose(np.cos(wrapped), np.cos(angle), atol=1e-9)
    assert np.isclose(np.sin(wrapped), np.sin(angle), atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 7])
def test_stacks_give_what_single_motions_give(count):
    v = np.random.default_rng(count).normal(size=(count, 3))
    T = se2.exp(v)
    assert T.shape == (count, 3, 3)
    for index in range(count):
        assert np.allclose(T[index], se2.exp(v[index]))
        assert np.allclose(se2.invert(T)[index], se2.invert(T[index]))
        assert np.allclose(se2.log(T)[index], v[index])


@given(_motions, _motions, st.tuples(*[st.floats(-1e-5, 1e-5)] * 3).map(np.array))
def test_information_keeps_the_cost_of_a_small_step_through_a_chain(T_a_b, T_b_c, v):
    information = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]])
    w = se2.log(se2.invert(T_a_b @ T_b_c) @ T_a_b @ se2.exp(v) @ T_b_c)
    cost = w @ se2.chain_information(information, T_b_c) @ w
    assert np.isclose(cost, v @ information @ v, rtol=1e-3, atol=1e-14)
