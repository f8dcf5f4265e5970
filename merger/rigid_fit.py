"""The rigid motion that fits paired points best in the least-squares sense (Eq. 6)."""

import numpy as np
import numpy.typing as npt

from merger import se2


def fit_motion(
    points_target: npt.NDArray[np.float64], points_source: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Find the motion that minimises ``sum |R p_source + t - p_target|^2`` in closed form.

    In the plane the singular value decomposition of Eq. 6 reduces to one arctangent, and the determinant is 1 by
    construction.

    Args:
        points_target: (..., N, 2) points in the target frame, metres, N >= 1.
        points_source: (..., N, 2) the points in the source frame that are paired with them.

    Returns:
        (..., 3, 3) ``T_target_source``. With all source points in one place the rotation is the identity.
    """
    count = points_source.shape[-2]
    center_target = np.add.reduce(points_target, axis=-2) / count
    center_source = np.add.reduce(points_source, axis=-2) / count
    target = points_target - center_target[..., None, :]
    source = points_source - center_source[..., None, :]
    products = np.swapaxes(source, -1, -2) @ target
    cosine = products[..., 0, 0] + products[..., 1, 1]
    sine = products[..., 0, 1] - products[..., 1, 0]
    T_target_source = se2.make_motion(0.0, 0.0, np.arctan2(sine, cosine))
    rotated = (T_target_source[..., :2, :2] @ center_source[..., None])[..., 0]
    T_target_source[..., :2, 2] = center_target - rotated
    return T_target_source
