"""IDs that are likely to be there, as evidence before a code word is read."""

from __future__ import annotations

import numpy as np

UNEXPECTED = 5.0
"""Logarithmic odds against an ID that is not expected, where others are: 150 to one.

What is expected wins a draw. An ID that is read clearly is no other one.
"""


def against(ids: np.ndarray, expected: frozenset[int]) -> np.ndarray:
    """Return the logarithmic odds against IDs before they are read, float64, of their shape.

    Without IDs that are expected, all are equally likely.

    Examples
    --------
    >>> against(np.array([7, 8]), frozenset({7, 9}))
    array([0., 5.])
    """
    if not expected:
        return np.zeros(np.shape(ids))
    return np.where(np.isin(ids, sorted(expected)), 0.0, UNEXPECTED)
