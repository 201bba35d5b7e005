"""Bands that something hides in part.

What hides a part of a band says nothing about it. It may be anything that leaves its own traces,
or something that looks just like the ground and leaves none where it ends on ground. Either is a
hypothesis for every word alike: it explains a stretch of the band at any angles, at a price, and
the word with the best explanation wins by what is left to be seen. `explanations` finds it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.detectors.ring.print_evidence import PrintEvidence
from ahf_ros.features.array_record import ArrayRecord

_FARTHER = 0.1  # price of hiding it at one more angle
_EDGES_OF_LIGHT = 60.0  # what the share of edges of light, and the unevenness, add to both
_UNEVEN_LIGHT = 60.0
_USUAL = 0.02  # of either
_MAXIMUM_PRICE = 20.0  # of what they add
_SECTOR = 2.0  # price of a hidden stretch of a sector, where sectors are looked at one by one
_NEAR = 3  # angles on either side of a border, by which it is seen or not

EVEN = 1.0
"""Price of what hides a band, beyond the usual, up to which the light is even."""


@dataclass(frozen=True, slots=True)
class HiddenEvidence(ArrayRecord):
    """Evidence about k bands that may be hidden in part, over bands of which nothing is seen.

    Attributes
    ----------
    seen : ndarray of float64, shape (k, 2, m)
        For ground and for a mark, where the band is seen.
    anything, like_ground : ndarray of float64, shape (k, 2, m)
        The same, where anything may lie before it, and where something like the ground may.
    onto, off : ndarray of float64, shape (k, m)
        For a border onto a mark and off it after each angle, where both sides are seen.
    price : ndarray of float64, shape (k,)
        What light with many edges adds to the price of anything that hides a band.
    """

    seen: np.ndarray
    anything: np.ndarray
    like_ground: np.ndarray
    onto: np.ndarray
    off: np.ndarray
    price: np.ndarray


def hidden_evidence(evidence: PrintEvidence) -> HiddenEvidence:
    """Return what evidence says where bands may be hidden."""
    halves = evidence.halves
    ground, mark = halves[:, 0], halves[:, 1]
    seen = halves.sum(axis=2)
    # Something as dark as ink may end near an edge of the band and look like that of a mark.
    inked = np.where(evidence.inked[:, ::-1], np.maximum(mark, ground), ground)
    # What lies before the band may leave the ground beside it free.
    beside = np.maximum(evidence.free, 0)[:, None]
    anything = np.maximum(np.stack([inked, mark], axis=1), beside).sum(axis=2)
    like_ground = np.stack([seen[:, 0], np.maximum(mark, ground).sum(axis=1)], axis=1)
    price = _EDGES_OF_LIGHT * np.maximum(evidence.edges - _USUAL, 0)
    price += _UNEVEN_LIGHT * np.maximum(evidence.uneven - _USUAL, 0)
    price = np.minimum(price, _MAXIMUM_PRICE)
    # An edge of light beside a mark may look like that of a mark whose other half is hidden.
    uneven = price > EVEN
    anything[uneven, 1] = np.maximum(seen[uneven, 1], beside[uneven].sum(axis=(1, 2)))
    like_ground[uneven, 1] = seen[uneven].max(axis=1)
    anything, like_ground = anything - _FARTHER, like_ground - _FARTHER
    before, after = _windows(seen)
    onto = evidence.onto * _probability(before[:, 0]) * _probability(after[:, 1])
    off = evidence.off * _probability(before[:, 1]) * _probability(after[:, 0])
    return HiddenEvidence(seen, anything, like_ground, onto, off, price)


def clearest(of: HiddenEvidence) -> np.ndarray:
    """Return the angles of each band from that on at which it is seen best, shape (k, m)."""
    best = of.seen.max(axis=1)
    window = np.sum([np.roll(best, shift, axis=1) for shift in range(-_NEAR, _NEAR + 1)], axis=0)
    return (window.argmax(axis=1)[:, None] + np.arange(best.shape[1])) % best.shape[1]


def turned(of: HiddenEvidence, order: np.ndarray) -> HiddenEvidence:
    """Return the evidence with its angles in an order, shape (k, m)."""

    def of_bits(part: np.ndarray) -> np.ndarray:
        return np.take_along_axis(part, order[:, None], axis=2)

    return HiddenEvidence(
        of_bits(of.seen),
        of_bits(of.anything),
        of_bits(of.like_ground),
        np.take_along_axis(of.onto, order, axis=1),
        np.take_along_axis(of.off, order, axis=1),
        of.price,
    )


def sector_evidence(of: HiddenEvidence, angles: np.ndarray) -> np.ndarray:
    """Return the evidence of sectors for ground and for a mark, hidden in part or not.

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands.
    angles : ndarray of int, shape (p, n, s)
        The angles of n sectors at p phases.

    Returns
    -------
    ndarray of float64, shape (k, 2, p, n)
    """
    # A sector is a run of angles from its first one on, and many sectors start at each angle.
    first, length = angles[..., 0], angles.shape[-1]
    either = np.maximum(of.anything, of.like_ground)
    gain = of.seen - either
    hidden, seen = np.zeros(either.shape), np.zeros(either.shape)
    most = part = np.zeros(either.shape)
    for index in range(length):
        later = np.roll(gain, -index, axis=2)
        part = np.maximum(part + later, 0)
        most = np.maximum(most, part)
        seen += later
        hidden += np.roll(either, -index, axis=2)
    evidence: np.ndarray = (hidden + np.maximum(seen, most - _SECTOR))[:, :, first]
    return evidence


def nothing_better(of: HiddenEvidence, bits: np.ndarray) -> np.ndarray:
    """Return how much better than words any states would be, borders apart, shape (k,).

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands at m angles.
    bits : ndarray of bool, shape (k, m)
        Whether the word of each band has a mark at each angle.
    """
    ground, mark = np.moveaxis(of.seen, 1, 0)
    best = np.maximum(np.maximum(ground, mark), of.anything.max(axis=1))
    best = np.maximum(best, of.like_ground[:, 0])
    return (best - np.where(bits, mark, ground)).sum(axis=1)


def _windows(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence at the last angles up to each one, and at the first ones after it."""
    before = [np.roll(seen, shift, axis=2) for shift in range(_NEAR)]
    after = [np.roll(seen, -shift, axis=2) for shift in range(1, _NEAR + 1)]
    return np.sum(before, axis=0), np.sum(after, axis=0)


def _probability(evidence: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(evidence, -30, 30)))
