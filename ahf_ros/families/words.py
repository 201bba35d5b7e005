"""Evidence for words: that of IDs before they are read, and of the best over all others."""

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


def margins(ids: np.ndarray, scores: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Return the evidence for the best words, indices (k,), over those of other IDs, shape (k,).

    From the IDs of words and the evidence for each, shape (k, c). Where all words have one ID,
    others have less evidence than the last of these.
    """
    rows = np.arange(len(ids))
    others = np.where(ids == ids[rows, best][:, None], -np.inf, scores).max(axis=1)
    others = np.where(np.isfinite(others), others, scores.min(axis=1))
    return np.asarray(scores[rows, best] - others)
