"""Dots in an image: what is known of each, and which of them are the same."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.neighbours import pairs_within

_SAME = 0.3  # largest distance of the centres of the same dot in its radius; of radii in ln
_PART = 100_000  # pairs looked at at a time, which bounds the memory
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
"""An empty record."""


def distinct(dots: Dots) -> Dots:
    """Return dots without duplicates, those with the largest share first."""
    order = np.lexsort((dots.frames[:, 0, 2], -dots.share))
    dots = dots.select(order)
    size, centres = frame.mean_radii(dots.frames), dots.frames[:, :2, 2]
    pairs = [(np.zeros(0, np.intp), np.zeros(0, np.intp))]
    for first, second in pairs_within(centres, _SAME * size, _PART):
        away = centres[second] - centres[first]
        same = np.hypot(away[:, 0], away[:, 1]) < _SAME * size[first]
        same &= dots.polarity[second] == dots.polarity[first]
        same &= np.abs(np.log(size[second] / size[first])) < _SAME
        pairs.append((first[same], second[same]))
    first, second = (np.concatenate(of) for of in zip(*pairs, strict=True))
    free = np.ones(len(size), bool)
    starts = np.searchsorted(first, np.arange(len(size) + 1))
    for index in np.unique(first).tolist():
        if free[index]:
            others = second[starts[index] : starts[index + 1]]
            free[others[others > index]] = False
    return dots.select(free)


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
    _LOG.warning('%d %s; the %d best are looked at', len(indices), what, limit)
    return np.sort(indices[np.argsort(ranks, kind='stable')[:limit]])
