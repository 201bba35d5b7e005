"""Bands that something hides in part.

What hides a part of a band says nothing about it. It may be anything that leaves its own traces,
or something that looks just like the ground and leaves none where it ends on ground. Either is a
hypothesis for every word alike: it explains a stretch of the band at any angles, at a price, and
the word with the best explanation wins by what is left to be seen. A dynamic program along the
band (Viterbi 1967) finds that explanation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.detectors.ring.print_evidence import PrintEvidence
from ahf_ros.features.array_record import ArrayRecord

_ANYTHING, _LIKE_GROUND = 5.0, 9.0  # price of something that hides a stretch of the band
_FARTHER = 0.1  # price of hiding it at one more angle
_EDGES_OF_LIGHT = 60.0  # what the share of edges of light, and the unevenness, add to both
_UNEVEN_LIGHT = 60.0
_USUAL = 0.02  # of either
_MAXIMUM_PRICE = 20.0  # of what they add
_SECTOR = 2.0  # price of a hidden stretch of a sector, where sectors are looked at one by one
_EDGE = 3.5  # price of an edge of a mark
_MAXIMUM_END = 3.0  # evidence for an end of something like the ground on a mark
_NEVER = -1e9
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
    either = np.maximum(of.anything, of.like_ground)
    hidden = either[:, :, angles]
    gain = (of.seen - either)[:, :, angles]
    most = part = np.zeros(gain.shape[:-1])
    for index in range(gain.shape[-1]):
        part = np.maximum(part + gain[..., index], 0)
        most = np.maximum(most, part)
    return hidden.sum(axis=-1) + np.maximum(gain.sum(axis=-1), most - _SECTOR)


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


def explained_words(of: HiddenEvidence, bits: np.ndarray) -> np.ndarray:
    """Return the evidence for words, each with what best explains that a part of it is hidden.

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands at m angles, `turned`.
    bits : ndarray of bool, shape (k, w, m)
        Whether each of w words has a mark at each angle.

    Returns
    -------
    ndarray of float64, shape (k, w)
    """
    seen, anything, like_ground = (
        np.moveaxis(np.where(bits, part[:, None, 1], part[:, None, 0]), 2, 0)
        for part in (of.seen, of.anything, of.like_ground)
    )
    after = np.roll(bits, -1, axis=2)
    onto, off = of.onto[:, None], of.off[:, None]
    ends = _ends_on_marks(of)
    border = np.where(after & ~bits, onto, np.where(bits & ~after, off, 0))
    begin, end = np.where(bits, ends[0][:, None], 0), np.where(after, ends[1][:, None], 0)
    border, begin, end = (np.moveaxis(part, 2, 0) for part in (border, begin, end))
    any_price, ground_price = _ANYTHING + of.price[:, None], _LIKE_GROUND + of.price[:, None]
    clear = seen[0]
    other = ground = np.full(clear.shape, _NEVER)
    for last in range(len(seen) - 1):
        best = np.maximum(np.maximum(clear, ground), other) - any_price
        begun = np.maximum(clear + begin[last], other) - ground_price
        clear = np.maximum(np.maximum(clear + border[last], other), ground + end[last])
        clear = clear + seen[last + 1]
        other = np.maximum(other, best) + anything[last + 1]
        ground = np.maximum(ground, begun) + like_ground[last + 1]
    return np.maximum(clear, np.maximum(other, ground))


def best_explanations(of: HiddenEvidence, bits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what best explains each word, and how much better arcs of any length would.

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands at m angles, `turned`.
    bits : ndarray of bool, shape (k, m)
        Whether the word of each band has a mark at each angle.

    Returns
    -------
    hidden : ndarray of bool, shape (k, m)
        Where the band is hidden.
    unexplained : ndarray of float64, shape (k,)
        Evidence for marks that begin and end anywhere, over that for the word. A codeword leaves
        nothing of the kind: where something else lies about a dot, this is large.
    """
    count, angles = bits.shape
    ground, mark = np.moveaxis(of.seen, 1, 0)
    words = np.stack(
        [
            np.where(bits, _NEVER, ground),
            np.where(bits, mark, _NEVER),
            np.where(bits, of.anything[:, 1], of.anything[:, 0]),
            np.where(bits, of.like_ground[:, 1], of.like_ground[:, 0]),
        ]
    )
    free = np.stack([ground, mark, of.anything.max(axis=1), of.like_ground[:, 0]])
    emission = np.concatenate([words, free], axis=1).transpose(2, 1, 0)
    moves = _moves(of)
    score = np.where(np.arange(4) < 2, emission[0], _NEVER)
    came = np.zeros((angles, 2 * count, 4), np.int8)
    for angle in range(1, angles):
        paths = score[:, :, None] + np.tile(moves[angle - 1], (2, 1, 1))
        came[angle] = paths.argmax(axis=1)
        score = paths.max(axis=1) + emission[angle]
    state, rows = score[:count].argmax(axis=1), np.arange(count)
    hidden = np.empty(bits.shape, bool)
    for angle in range(angles - 1, -1, -1):
        hidden[:, angle] = state > 1
        state = came[angle][rows, state]
    word, free_arcs = np.split(score.max(axis=1), 2)
    return hidden, free_arcs - word


def _moves(of: HiddenEvidence) -> np.ndarray:
    """Return the evidence for moves between states after each angle, shape (m, k, 4, 4).

    States are ground, mark, anything, something like the ground.
    """
    count, angles = of.onto.shape
    moves = np.zeros((4, 4, angles, count))
    moves[0, 1], moves[1, 0] = of.onto.T - _EDGE, of.off.T - _EDGE
    moves[:, 2], moves[:, 3] = -_ANYTHING - of.price, -_LIKE_GROUND - of.price
    moves[2, 2] = moves[3, 3] = 0
    begin, end = _ends_on_marks(of)
    moves[1, 3] += begin.T
    moves[3, 1] += end.T
    return np.ascontiguousarray(moves.transpose(2, 3, 0, 1))


def _ends_on_marks(of: HiddenEvidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence that something like the ground begins on a mark, and that it ends there.

    It makes an edge of its own.
    """
    return np.clip(of.off, 0, _MAXIMUM_END), np.clip(of.onto, 0, _MAXIMUM_END)


def _windows(seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence at the last angles up to each one, and at the first ones after it."""
    before = [np.roll(seen, shift, axis=2) for shift in range(_NEAR)]
    after = [np.roll(seen, -shift, axis=2) for shift in range(1, _NEAR + 1)]
    return np.sum(before, axis=0), np.sum(after, axis=0)


def _probability(evidence: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(evidence, -30, 30)))
