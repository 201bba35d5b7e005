"""Pairs of points that are near to each other."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np


def pairs_within(
    points: np.ndarray, reach: np.ndarray, part: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the ordered pairs of points where the second is within reach of the first.

    Parameters
    ----------
    points : ndarray of float64, shape (n, 2)
    reach : ndarray of float64, shape (n,)
        Half the side of the square about each point; 0 where none is asked for.
    part : int
        Pairs that are looked at at a time, about; it bounds the memory.

    Yields
    ------
    first, second : ndarray of int, shape (k,)
        Indices of points. All pairs with one first point come together, and ascending.
    """
    asked = reach[reach > 0]
    if not len(asked):
        return
    x, y = (points - points.min(axis=0)).T
    # Strips as high as the usual reach, each sorted by x, have their neighbours in a few runs.
    height = max(float(np.median(asked)), 1e-9)
    width = float(x.max() + 2 * reach.max() + 1)
    strip = np.floor(y / height)
    key = strip * width + x
    order = np.argsort(key, kind='stable')
    key = key[order]
    lowest, highest = np.floor((y - reach) / height), np.floor((y + reach) / height)
    lowest, highest = np.maximum(lowest, 0), np.minimum(highest, strip.max())
    strips = (highest - lowest + 1).astype(int)
    owner = np.repeat(np.arange(len(points)), strips)
    row = lowest[owner] + _counted(strips)
    begin = np.searchsorted(key, row * width + np.maximum(x - reach, 0)[owner])
    end = np.searchsorted(key, row * width + (x + reach)[owner], side='right')
    count = end - begin
    total = np.concatenate([[0], np.cumsum(np.bincount(owner, count, len(points)))])
    marks = np.searchsorted(total, np.arange(0, total[-1] + part, part))
    runs = np.concatenate([[0], np.cumsum(strips)])
    for low, high in pairwise(np.unique(np.minimum(marks, len(points)))):
        of_part = slice(runs[low], runs[high])
        first = np.repeat(owner[of_part], count[of_part])
        second = order[np.repeat(begin[of_part], count[of_part]) + _counted(count[of_part])]
        near = (np.abs(y[second] - y[first]) < reach[first]) & (first != second)
        yield first[near], second[near]


def _counted(counts: np.ndarray) -> np.ndarray:
    """Return 0, 1, 2 to n - 1 for each of the counts n, shape (sum of n,)."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
