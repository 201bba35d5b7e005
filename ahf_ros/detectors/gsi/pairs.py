"""Pairs of dots that may belong to one target."""

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

_RADII = (0.065, 0.43)
# Of dots, in the least distance of two template dots: 1.0 to 3.6 mm where these are 11 mm apart,
# and a third more for bright ones that bloom.
_SIZE_RATIO = 0.55  # of two dots of a target, in ln, for their printed sizes
_STEPS = 4  # of the distance to which neighbours are looked for, until there are many
_CROWD = (4.0, 1.25)
# Times as dense as the dots of a target in the circle about it, from which on neighbours make a
# pattern of light; and the same where only obvious targets are looked for. Bright targets in
# bright lattices are lost with 3.


@dataclass(frozen=True, slots=True)
class Pairs:
    """Ordered pairs of neighbours, sorted by the first one, then by their length.

    Attributes
    ----------
    first, second : ndarray of int, shape (p,)
        Indices of dots.
    offset : ndarray of complex128, shape (p,)
        From the first to the second, y up, in units of the ellipse of the first.
    crowd : ndarray of float64, shape (p,)
        How far from the first dot there are so many others that no target is that large.
    error : tuple of 2 float
        Of the offsets: a share of their length, and what is added to it.
    """

    first: np.ndarray
    second: np.ndarray
    offset: np.ndarray
    crowd: np.ndarray
    error: tuple[float, float]

    def as_long_as(self, first: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the pairs with given first dots and about given lengths begin and end."""
        own = np.abs(self.offset)
        apart = 2 * own.max(initial=0.0) + 1
        key, error = self.first * apart + own, self.error_at(lengths)
        low, high = np.maximum(lengths - error, 0), np.minimum(lengths + error, apart / 2)
        begin = np.searchsorted(key, first * apart + low)
        return begin, np.maximum(np.searchsorted(key, first * apart + high), begin)

    def error_at(self, lengths: np.ndarray) -> np.ndarray:
        """Return how far offsets may be from where they should be at some lengths."""
        return self.error[0] * lengths + self.error[1]


def radius_scales(family: PointFamily) -> tuple[float, float]:
    """Return the bounds of the radii that dots may have, in those of the printed design."""
    places = family.places[: len(family.template)]
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    least = float(gaps[gaps > 0].min()) / float(family.template_radii[family.reference])
    smallest, largest = _RADII
    return min(smallest * least, 1.0), max(largest * least, 1.0)


def neighbours(
    dots: Dots,
    family: PointFamily,
    triples: Sequence[tuple[int, int, int]],
    error: tuple[float, float],
    *,
    obvious: bool,
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
    obvious : bool
        Whether only targets without many other dots about them are looked for.
    """
    places = family.places[: len(family.template)]
    smallest, largest = radius_scales(family)
    longest = max(
        float(np.hypot(*(places[list(others)] - places[role]).T).max())
        / float(family.template_radii[role])
        for role, *others in triples
    )
    nearest, farthest = ((1 + error[0]) * longest / of + error[1] for of in (largest, smallest))
    own = float(family.template_radii[family.reference])
    circles = ((1 + error[0]) * longest * own / family.reach) ** 2
    crowd = round(_CROWD[obvious] * circles * (len(places) + family.rule.dots))
    centres = dots.frames[:, :2, 2]
    major = frame.ellipse_axes(dots.frames)[0]
    inverse = np.linalg.inv(dots.frames[:, :2, :2])
    widest = np.log(family.template_radii.max() / family.template_radii.min())
    limit = np.full(len(centres), np.inf)
    parts = [(np.zeros(0, int), np.zeros(0, int), np.zeros(0, complex))]
    for reach in np.geomspace(nearest, farthest, _STEPS):
        alone = np.isinf(limit)
        for first, second in pairs_within(centres, np.where(alone, reach * major, 0.0), PART):
            near = np.abs(np.log(major[second] / major[first])) < _SIZE_RATIO + widest
            first, second = first[near], second[near]
            difference = centres[second] - centres[first]
            across, down = (inverse[first] @ difference[..., None])[..., 0].T
            offset = across - 1j * down
            length = np.abs(offset) / (2 * reach)
            near = np.flatnonzero(length < 0.5)
            order = near[np.argsort(first[near] + length[near])]
            first, second, offset = first[order], second[order], offset[order]
            rank = np.arange(len(first)) - np.searchsorted(first, first)
            last = rank == crowd
            limit[first[last]] = np.abs(offset[last])
            near = rank < crowd
            if reach < farthest:
                near &= np.isfinite(limit[first])
            parts.append((first[near], second[near], offset[near]))
    first, second, offset = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(first, kind='stable')
    first, second, offset = first[order], second[order], offset[order]
    return Pairs(first, second, offset, limit[first], error)
