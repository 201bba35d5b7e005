"""The integral of the normal distribution, which is the edge that a blur makes of a step."""

from __future__ import annotations

import math

import numpy as np

_SCALE = math.sqrt(2 / math.pi)
_CUBIC = 0.044715


def normal_integral(values: np.ndarray) -> np.ndarray:
    """Return the share of a normal distribution below values, to 0.0002, in their dtype and shape.

    The logistic approximation with a cubic term is Page's [1]_.

    References
    ----------
    .. [1] Page, Approximations to the cumulative normal function and its inverse for use on a
       pocket calculator, J. R. Stat. Soc. C 26(1), 1977, 75-76.

    Examples
    --------
    >>> normal_integral(np.array([-1.0, 0.0, 6.0])).round(3)
    array([0.159, 0.5  , 1.   ])
    """
    share: np.ndarray = 0.5 * (1 + np.tanh(_SCALE * values * (1 + _CUBIC * values * values)))
    return share
