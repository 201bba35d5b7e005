"""The integral of the normal distribution, which is the edge that a blur makes of a step."""

from __future__ import annotations

import math

import numpy as np

_SCALE = math.sqrt(2 / math.pi)
_CUBIC = 0.044715
_PLACE = 0.3275911
_TAIL = 1.061405429, -1.453152027, 1.421413741, -0.284496736, 0.254829592


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
    share = _CUBIC * values
    share *= values
    share += 1
    share *= _SCALE * values
    share = np.tanh(share)
    share += 1
    share *= 0.5
    return share


def exact_normal_integral(values: np.ndarray) -> np.ndarray:
    """Return the share of a normal distribution below values, to 1e-7, float64 of their shape.

    The rational approximation is 7.1.26 of Abramowitz and Stegun [1]_.

    References
    ----------
    .. [1] Abramowitz & Stegun, Handbook of Mathematical Functions, 1964.

    Examples
    --------
    >>> exact_normal_integral(np.array([-1.0, 0.0, 6.0])).round(6)
    array([0.158655, 0.5     , 1.      ])
    """
    size = np.abs(values) / math.sqrt(2)
    place = 1 / (1 + _PLACE * size)
    tail = np.zeros_like(size)
    for coefficient in _TAIL:
        tail = (tail + coefficient) * place
    tail *= np.exp(-(size**2)) / 2
    return np.where(values > 0, 1 - tail, tail)
