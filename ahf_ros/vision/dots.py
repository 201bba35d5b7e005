"""Dots in an image: what is known of each, which are near others, and which are the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ahf_ros.base.notices import tell_left_out
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord

_SAME = 0.3  # largest distance of the centres of the same dot in its radius; of radii in ln
_PART = 100_000  # pairs looked at at a time, which bounds the memory


@dataclass(frozen=True, slots=True)
class Dots(ArrayRecord):
    """k elliptic dots."""

    frames: np.ndarray  # (k, 3, 3), affine, from the unit circle onto the ellipse, px
    polarity: np.ndarray  # int, (k,), 1 for a dark dot on bright ground, -1 for a bright one
    share: np.ndarray  # (k,), of the ellipse where the image shows an edge


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
    """Return at most `limit` of k indices, those of the lowest ranks, in their order.

    If any is left out, a warning says of what.
    """
    if len(indices) <= limit:
        return indices
    tell_left_out(len(indices), what, limit)
    return np.sort(indices[np.argsort(ranks, kind='stable')[:limit]])


def pairs_within(
    points: np.ndarray, reach: np.ndarray, part: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the ordered pairs of points where the second is within reach of the first.

    The reach, shape (n,), is half the side of the square about each of the points, shape (n, 2);
    0 where no pairs are asked for. The indices of first and second points come in parts of about
    `part` pairs that are looked at, which bounds the memory. All pairs with one first point come
    together, and ascending.
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
