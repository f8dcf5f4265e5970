"""Rigid motions of the plane, SE(2): the only place where their mathematics is written.

A motion is a (3, 3) float64 array ``T_a_b = [[R, t], [0, 1]]`` (Eqs. 1-2) that maps points of frame b into
frame a; a stack is (N, 3, 3). Motions are composed with ``@``. A tangent vector is ``(u1, u2, omega)``: metres,
metres, radians, the paper's vec() of the Lie algebra (Eq. 12). Every function takes one motion or a stack.

Note: Eq. 13 prints ones on the diagonal of Omega; so(2) has zeros there, and zeros are used here.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_SMALL_ANGLE_RAD = 1e-6
"""Below it the Taylor series of the exponential and logarithm are exact to double precision."""


def wrap_angle(angle_rad: npt.ArrayLike) -> Array:
    """Wrap angles in radians into (-pi, pi]; the shape is kept."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return np.asarray(np.pi - np.mod(np.pi - angle, 2.0 * np.pi))


def make_motion(x_m: npt.ArrayLike, y_m: npt.ArrayLike, theta_rad: npt.ArrayLike) -> Array:
    """Build motions from translation in metres and angle in radians, each of shape (...).

    Returns:
        (..., 3, 3) motions.
    """
    x, y, theta = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (x_m, y_m, theta_rad)))
    T = np.zeros((*x.shape, 3, 3))
    cosine, sine = np.cos(theta), np.sin(theta)
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 2] = cosine, -sine, x
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 2] = sine, cosine, y
    T[..., 2, 2] = 1.0
    return T


def angle_of(T: Array) -> Array:
    """Rotation angle in radians, in (-pi, pi]: (..., 3, 3) to (...)."""
    angle = np.arctan2(T[..., 1, 0], T[..., 0, 0])
    return np.asarray(np.where(angle == -np.pi, np.pi, angle))


def parameters_of(T: Array) -> Array:
    """The (..., 3) parameters ``x_m, y_m, theta_rad`` of (..., 3, 3) motions: the inverse of `make_motion`."""
    return np.stack([T[..., 0, 2], T[..., 1, 2], angle_of(T)], axis=-1)


def invert(T_a_b: Array) -> Array:
    """The inverse motions ``T_b_a``: (..., 3, 3) to (..., 3, 3), exactly rigid."""
    R_b_a = np.swapaxes(T_a_b[..., :2, :2], -1, -2)
    T_b_a = np.zeros_like(T_a_b)
    T_b_a[..., :2, :2] = R_b_a
    T_b_a[..., :2, 2] = -(R_b_a @ T_a_b[..., :2, 2, None])[..., 0]
    T_b_a[..., 2, 2] = 1.0
    return T_b_a


def transform_points(T_a_b: Array, points_b: Array) -> Array:
    """Map (..., N, 2) points of frame b, in metres, into frame a by (..., 3, 3) motions."""
    rotated = points_b @ np.swapaxes(T_a_b[..., :2, :2], -1, -2)
    return np.asarray(rotated + T_a_b[..., None, :2, 2])


def exp(v: Array) -> Array:
    """Exponential map: (..., 3) tangent vectors ``(u1, u2, omega)`` to (..., 3, 3) motions (Eq. 19's expm)."""
    omega = v[..., 2]
    a, b = _series(omega)
    return make_motion(a * v[..., 0] - b * v[..., 1], b * v[..., 0] + a * v[..., 1], omega)


def log(T: Array) -> Array:
    """Logarithm: (..., 3, 3) motions to (..., 3) tangent vectors, omega in (-pi, pi] (Eq. 12).

    ``exp(log(T)) == T`` for every motion, at a half turn, too.
    """
    omega = angle_of(T)
    a, b = _series(omega)
    scale = a * a + b * b
    x, y = T[..., 0, 2], T[..., 1, 2]
    return np.stack([(a * x + b * y) / scale, (a * y - b * x) / scale, omega], axis=-1)


def adjoint(T: Array) -> Array:
    """Adjoint (..., 3, 3) of motions: ``T @ exp(v) @ inv(T) == exp(adjoint(T) @ v)``, v = (u1, u2, omega)."""
    adj = np.array(T, dtype=np.float64)
    adj[..., 0, 2] = T[..., 1, 2]
    adj[..., 1, 2] = -T[..., 0, 2]
    return adj


def chain_information(information: Array, T_b_c: Array) -> Array:
    """Information of ``T_a_b @ T_b_c`` by that of ``T_a_b``, each (..., 3, 3) and of v in ``T @ exp(v)``."""
    # T_a_b exp(v) T_b_c = T_a_c exp(w) with v = Ad(T_b_c) w.
    adj = adjoint(T_b_c)
    return np.asarray(np.swapaxes(adj, -1, -2) @ information @ adj)


def _series(omega: Array) -> tuple[Array, Array]:
    """``sin(w)/w`` and ``(1-cos(w))/w``, by their Taylor series near zero."""
    small = np.abs(omega) < _SMALL_ANGLE_RAD
    safe = np.where(small, 1.0, omega)
    a = np.where(small, 1.0 - omega * omega / 6.0, np.sin(safe) / safe)
    b = np.where(small, omega / 2.0, 2.0 * np.sin(safe / 2.0) ** 2 / safe)
    return a, b
