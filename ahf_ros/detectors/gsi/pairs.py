"""Pairs of dots that may belong to one target, by distance and size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.features import frame
from ahf_ros.features.dots import Dots
from ahf_ros.features.neighbours import pairs_within

PART = 400_000
"""Pairs or triples of dots at a time, which bounds the memory."""

_SIZE_RATIO = 0.55  # of two dots of a target, in ln, for their printed sizes
_CROWD = 5  # times the dots of a target, from which on so many neighbours make a pattern of light


@dataclass(frozen=True, slots=True)
class Pairs:
    """Ordered pairs of neighbours, sorted by the first one.

    Attributes
    ----------
    first, second : ndarray of int, shape (p,)
        Indices of dots.
    offset : ndarray of float64, shape (p, 2)
        From the first to the second, y up, in units of the ellipse of the first.
    start : ndarray of int, shape (k + 1,)
        Where the pairs of each dot begin.
    error : tuple of 2 float
        Of the offsets: a share of their length, and what is added to it.
    """

    first: np.ndarray
    second: np.ndarray
    offset: np.ndarray
    start: np.ndarray
    error: tuple[float, float]

    def at(self, arm: np.ndarray) -> Pairs:
        """Return the pairs that are about as far apart as a printed arm is long."""
        length = np.hypot(*arm)
        near = np.abs(np.hypot(*self.offset.T) - length) < self.error_at(length)
        before = np.concatenate([[0], np.cumsum(near)])
        columns = (self.first[near], self.second[near], self.offset[near])
        return Pairs(*columns, before[self.start], self.error)

    def error_at(self, length: float) -> float:
        """Return how far an offset may be from where it should be at a length."""
        return self.error[0] * length + self.error[1]


def neighbours(
    dots: Dots,
    family: PointFamily,
    triples: Sequence[tuple[int, int, int]],
    error: tuple[float, float],
) -> Pairs:
    """Return the pairs of dots of similar size that one template may hold in some roles.

    Parameters
    ----------
    dots : Dots
        Of one polarity.
    family : PointFamily
    triples : sequence of tuple of 3 int
        Template dots: the role of the first dot of a pair, and those of the second.
    error : tuple of 2 float
        As in `Pairs`.
    """
    places = family.places[: len(family.template)]
    longest = max(
        float(np.hypot(*(places[list(others)] - places[role]).T).max() / radius)
        for role, *others in triples
        for radius in family.template_radii[[role]]
    )
    reach = (1 + error[0]) * longest + error[1]
    centres = dots.frames[:, :2, 2]
    major = frame.ellipse_axes(dots.frames)[0]
    inverse = np.linalg.inv(dots.frames[:, :2, :2])
    widest = np.log(family.template_radii.max() / family.template_radii.min())
    crowd = _CROWD * (len(places) + family.rule.dots)
    parts = [(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))]
    for first, second in pairs_within(centres, reach * major, PART):
        near = np.abs(np.log(major[second] / major[first])) < _SIZE_RATIO + widest
        first, second = first[near], second[near]
        difference = centres[second] - centres[first]
        offset = (inverse[first] @ difference[..., None])[..., 0] * [1, -1]
        distance = np.hypot(*offset.T)
        near = distance < reach
        near &= np.bincount(first, near, len(centres))[first] < crowd
        parts.append((first[near], second[near], offset[near]))
    first, second, offset = (np.concatenate(column) for column in zip(*parts, strict=True))
    start = np.searchsorted(first, np.arange(len(centres) + 1))
    return Pairs(first, second, offset, start, error)
