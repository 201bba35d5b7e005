"""Dots in an image: what is known of each, and which of them are the same."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord

_SAME = 0.3  # largest distance of the centres of the same dot in its radius; of radii in ln
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Dots(ArrayRecord):
    """k elliptic dots.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        Affine, from the unit circle onto the ellipse, px.
    polarity : ndarray of int, shape (k,)
        1 for a dark dot on bright ground, -1 for a bright one on dark.
    share : ndarray of float64, shape (k,)
        Share of the ellipse where the image shows an edge.
    """

    frames: np.ndarray
    polarity: np.ndarray
    share: np.ndarray


NO_DOTS = Dots(np.zeros((0, 3, 3)), np.zeros(0, int), np.zeros(0))
"""The record of none."""


def distinct(dots: Dots) -> Dots:
    """Return dots without duplicates, those with the largest share first."""
    size = frame.mean_radii(dots.frames)
    order = np.argsort(dots.frames[:, 0, 2], kind='stable')  # neighbours are near in this order
    x, y, size = dots.frames[order, 0, 2], dots.frames[order, 1, 2], size[order]
    polarity = dots.polarity[order]
    first, last = np.searchsorted(x, x - _SAME * size), np.searchsorted(x, x + _SAME * size)
    kept: list[int] = []
    free = np.ones(len(x), bool)
    for index in np.argsort(-dots.share[order], kind='stable'):
        if free[index]:
            kept.append(int(order[index]))
            near = slice(first[index], last[index] + 1)
            same = np.hypot(x[near] - x[index], y[near] - y[index]) < _SAME * size[index]
            same &= polarity[near] == polarity[index]
            free[near] &= ~(same & (np.abs(np.log(size[near] / size[index])) < _SAME))
    return dots.select(np.array(kept, np.intp))


def best(indices: np.ndarray, ranks: np.ndarray, limit: int, what: str) -> np.ndarray:
    """Return the indices of the lowest ranks, in their order; log a warning if any is left out.

    Parameters
    ----------
    indices, ranks : ndarray, shape (k,)
    limit : int
        Maximum number of indices returned.
    what : str
        What the indices are of, for the warning.
    """
    if len(indices) <= limit:
        return indices
    _LOG.warning('%d %s, of which the %d best are looked at', len(indices), what, limit)
    return np.sort(indices[np.argsort(ranks, kind='stable')[:limit]])
