"""The competition of code words for the evidence of sectors."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.prints.cyclic import rotated_words
from ahf_ros.prints.ring import RingPrint

_EXHAUSTIVE = 50_000  # rotations of words, up to which all of them compete
_MINIMUM_EVIDENCE = 0.5  # for ones, in units of ln

COMPETITORS = 24
"""Number of words of each band that are returned, more than there are rotations of one."""

_PHASES = 4  # of a band, at which words compete
_UNCERTAIN = 10  # sectors whose bits are varied where not all words compete
_UNEXPECTED = 25.0  # evidence against words that are not expected, more than for a cover


def best_words(
    ones: np.ndarray,
    pairs: np.ndarray,
    family: RingPrint,
    expected: frozenset[int] = frozenset(),
) -> tuple[np.ndarray, np.ndarray]:
    """Return the valid words with the most evidence, and the best phase of each.

    Both have the shape (k, COMPETITORS), the best first, words in the rotation read and 0 where
    there is none. `ones`, shape (k, p, n), is the evidence for a one over a zero in each of n
    bits, and `pairs` what one after another one adds, because arcs spread beyond their sectors.

    Bands without evidence for any mark are not read. In the others every rotation of every word
    competes at the likeliest of p phases, which are ways to divide the band into sectors. In
    families of more than 50000 rotations, only those words compete that differ from the sectors'
    own evidence in the ten least certain sectors at most.
    """
    ranked_by = [expected, frozenset[int]()] if expected else [expected]
    words, phases = np.zeros((2, len(ones), COMPETITORS * len(ranked_by)), np.int64)
    bits, highest = likeliest_bits(ones, pairs)
    hopeful = np.flatnonzero(highest.max(axis=1, initial=0) > _MINIMUM_EVIDENCE)
    likely = np.argsort(-highest, axis=1, kind='stable')[:, :_PHASES]
    of_ones, of_pairs, bits = (
        np.take_along_axis(of, likely[..., None], axis=1) for of in (ones, pairs, bits)
    )
    everything = len(family.words) * family.bits <= _EXHAUSTIVE
    for some in [hopeful] if everything else hopeful[:, None]:
        if everything:
            competing = _all_rotations(family)
        else:
            sectors = _beside(*(of[some[0]] for of in (bits, of_ones, of_pairs)))
            competing = _near_rotations(sectors, family, expected)
        of_bands = of_ones[some], of_pairs[some], competing
        found = [
            kernels.competing_words(*of_bands, prior(competing, family, likely_ids), c=COMPETITORS)
            for likely_ids in ranked_by
        ]
        words[some], phase = (np.hstack([best[of] for best in found]) for of in (0, 1))
        phases[some] = np.take_along_axis(likely[some], phase, axis=1)
    return words, phases


def likeliest_bits(ones: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bits, valid or not, with the most evidence, and that, (..., n) bool and (...,).

    The evidence is that of `best_words`. By dynamic programming, once for each first bit.
    """
    of_bands = (of.reshape(-1, of.shape[-1]) for of in (ones, pairs))
    bits, highest, _ = kernels.likeliest_bits(*of_bands)
    return bits.reshape(ones.shape), highest.reshape(ones.shape[:-1])


def _beside(bits: np.ndarray, ones: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the evidence for ones over zeros beside other bits as they are, all (..., n)."""
    joined: np.ndarray = pairs * np.roll(bits, 1, axis=-1)
    return ones + joined + np.roll(pairs, -1, axis=-1) * np.roll(bits, -1, axis=-1)


def prior(words: np.ndarray, family: RingPrint, expected: frozenset[int]) -> np.ndarray:
    """Return the evidence for words in any rotation before they are read, float32, of their shape.

    `expected` are the IDs that are likely. Empty: all IDs are equally likely.
    """
    if not expected:
        return np.zeros(words.shape, np.float32)
    likely = np.isin(words, _expected_rotations(family, expected))
    return np.where(likely, np.float32(0), np.float32(-_UNEXPECTED))


@cache
def _all_rotations(family: RingPrint) -> np.ndarray:
    """Return all rotations of all words."""
    return _rotated(family.words, family)


def _near_rotations(
    sectors: np.ndarray, family: RingPrint, expected: frozenset[int]
) -> np.ndarray:
    """Return the words near to what the sectors say at any of the phases, ascending.

    Those that are expected compete as well.
    """
    # In ascending order, the words of a phase ascend, which makes sorting fast.
    uncertain = np.sort(np.argsort(np.abs(sectors), axis=1)[:, :_UNCERTAIN], axis=1)
    certain = (sectors > 0) @ (1 << np.arange(family.bits)) & ~(1 << uncertain).sum(axis=1)
    words = (certain[:, None] + (1 << uncertain) @ _choices()).ravel()
    valid = words[_are_words(family)[words]]
    # At least two words have to compete.
    words = np.concatenate([valid, family.words[:2], _expected_rotations(family, expected)])
    words.sort(kind='stable')
    new = np.ones(len(words), bool)
    np.not_equal(words[1:], words[:-1], out=new[1:])
    return words[new]


@cache
def _choices() -> np.ndarray:
    """Return all choices of uncertain bits, ascending, (uncertain, choices)."""
    return np.arange(1 << _UNCERTAIN) >> np.arange(_UNCERTAIN)[:, None] & 1


@lru_cache(maxsize=8)
def _are_words(family: RingPrint) -> np.ndarray:
    """Return whether numbers are rotations of words, (2^bits,)."""
    words = np.zeros(1 << family.bits, bool)
    for turn in range(family.bits):
        words[rotated_words(family.words, turn, family.bits)] = True
    return words


@lru_cache(maxsize=8)
def _expected_rotations(family: RingPrint, numbers: frozenset[int]) -> np.ndarray:
    """Return all rotations of the words with some IDs, ascending."""
    return _rotated(family.words[np.isin(family.numbers, list(numbers))], family)


def _rotated(words: np.ndarray, family: RingPrint) -> np.ndarray:
    """Return all rotations of words, ascending."""
    turns = [rotated_words(words, turn, family.bits) for turn in range(family.bits)]
    return np.unique(turns)
