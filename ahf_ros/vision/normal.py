"""The integral of the normal distribution, which is the edge that a blur makes of a step."""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels


def normal_integral(values: np.ndarray) -> np.ndarray:
    """Return the share of a normal distribution below values, to 1e-7, in their dtype and shape.

    See `normal_share` in kernels/elementary.h.

    Examples
    --------
    >>> normal_integral(np.array([-1.0, 0.0, 6.0])).round(6)
    array([0.158655, 0.5     , 1.      ])
    """
    return kernels.normal_shares(values.ravel()).reshape(values.shape).astype(values.dtype)
