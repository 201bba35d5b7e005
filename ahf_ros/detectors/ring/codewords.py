"""The competition of code words for the evidence of sectors and of the borders between them."""

from __future__ import annotations

from functools import cache

import numpy as np

from ahf_ros.codes.ring import Family

_EXHAUSTIVE = 50_000  # rotations of words, up to which all of them compete
_MINIMUM_EVIDENCE = 10.0  # for ones, in units of ln
_UNCERTAIN = 10  # sectors whose bits are varied where not all words compete


def best_words(
    sectors: np.ndarray, onto: np.ndarray, off: np.ndarray, family: Family
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the valid words with the most evidence.

    Bands without evidence for any mark are not read. In the others every rotation of every word
    competes at p phases, which are p ways to divide the band into sectors. In families of more
    than 50000 rotations, only those words compete that differ from the sectors' own evidence in
    the ten least certain sectors at most.

    Parameters
    ----------
    sectors : ndarray of float, shape (k, p, n)
        Evidence for one in each of the n bits of k bands.
    onto, off : ndarray of float, shape (k, p, n)
        Evidence for zero followed by one, and for one followed by zero, at the border after each
        sector, over equal bits.
    family : Family

    Returns
    -------
    words : ndarray of int64, shape (k,)
        The best word, in the rotation read; 0 where there is none.
    phases : ndarray of int, shape (k,)
        Its phase.
    margins : ndarray of float64, shape (k,)
        Its evidence over that of the best word with another ID.
    weakest : ndarray of float64, shape (k,)
        Evidence of the least certain sector for its own bit.
    """
    # A border between the bits a and b gives onto (1 - a) b + off a (1 - b).
    single = sectors + off + np.roll(onto, 1, axis=2)
    evidence = np.concatenate([single, -(onto + off)], axis=2).astype(np.float32)
    words = np.zeros(len(sectors), np.int64)
    phases, margins = np.zeros(len(sectors), np.intp), np.zeros(len(sectors))
    everything = len(family.words) * family.bits <= _EXHAUSTIVE
    hopeful = np.maximum(sectors, 0).sum(axis=2).max(axis=1) > _MINIMUM_EVIDENCE
    for index in np.flatnonzero(hopeful):
        competing, starts, features = (
            _all_rotations(family) if everything else _near_rotations(single[index], family)
        )
        scores = evidence[index] @ features
        of_word = scores.max(axis=0)
        best = of_word.argmax()
        words[index], phases[index] = competing[best], scores[:, best].argmax()
        second, first = np.partition(np.maximum.reduceat(of_word, starts), -2)[-2:]
        margins[index] = first - second
    own = np.take_along_axis(sectors, phases[:, None, None], axis=1)[:, 0]
    bits = 2 * (words[:, None] >> np.arange(family.bits) & 1) - 1
    return words, phases, margins, (own * bits).min(axis=1)


@cache
def _all_rotations(family: Family) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the features of all rotations of all words, see `_features`."""
    numbers = _number_table(family)
    return _features(np.flatnonzero(numbers), numbers, family.bits)


def _near_rotations(
    single: np.ndarray, family: Family
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the features of the words near to what the sectors say at any of the phases."""
    uncertain = np.argsort(np.abs(single), axis=1)[:, :_UNCERTAIN]
    certain = (single > 0) @ (1 << np.arange(family.bits)) & ~(1 << uncertain).sum(axis=1)
    choices = np.arange(1 << _UNCERTAIN)[:, None] >> np.arange(_UNCERTAIN) & 1
    words = np.unique(certain[:, None] + (1 << uncertain) @ choices.T)
    numbers = _number_table(family)
    valid = words[numbers[words] > 0]
    # At least two words have to compete.
    return _features(np.union1d(valid, family.words[:2]), numbers, family.bits)


@cache
def _number_table(family: Family) -> np.ndarray:
    """Return the IDs of all words of n bits in any rotation, 0 for those that have none."""
    numbers = np.zeros(1 << family.bits, np.int32)
    words = family.words
    for _ in range(family.bits):
        numbers[words] = np.arange(1, len(words) + 1)
        words = words >> 1 | (words & 1) << (family.bits - 1)
    return numbers


def _features(
    words: np.ndarray, numbers: np.ndarray, bits: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return words in the order of their IDs, where each ID starts, and what evidence weighs.

    The last is of shape (2 n, number of words): the bits and the products of neighbouring ones.
    """
    words = words[np.argsort(numbers[words], kind='stable')]
    starts = np.flatnonzero(np.diff(numbers[words], prepend=0))
    ones = (words >> np.arange(bits)[:, None] & 1).astype(np.float32)
    return words, starts, np.concatenate([ones, ones * np.roll(ones, -1, axis=0)])
