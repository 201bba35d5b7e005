"""Families of code words that are read round a circle, so that turned words are one code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

Words = TypeVar('Words', int, np.ndarray)


@dataclass(frozen=True, slots=True, eq=False)
class CyclicFamily:
    """Code words in the order of their IDs.

    Attributes
    ----------
    name : str
        Name of the family.
    bits : int
        Length of a word.
    words : ndarray of int64, shape (n,)
        The canonical code words, ascending and read-only; index i has the ID i + 1.
    """

    name: str
    bits: int
    words: np.ndarray

    def canonical(self, words: Any) -> np.ndarray:
        """Return the smallest of all words that are the same code, ndarray of int64."""
        return smallest_rotation(words, self.bits)

    def number(self, word: int) -> int | None:
        """Return the ID of `word` wherever its reading begins; None where there is none."""
        if not 0 <= word < 1 << self.bits:
            return None
        canonical = int(self.canonical(word))
        index = int(np.searchsorted(self.words, canonical))
        if index < self.words.size and self.words[index] == canonical:
            return index + 1
        return None

    def word(self, number: int) -> int:
        """Return the canonical code word of the ID `number`.

        Raises
        ------
        ValueError
            If the family has no such ID.
        """
        if not 1 <= number <= self.words.size:
            raise ValueError(
                f'number is {number!r}, accepted is an ID of {self.name} from 1 to '
                f'{self.words.size}'
            )
        return int(self.words[number - 1])


def smallest_rotation(words: Any, bits: int) -> np.ndarray:
    """Return the smallest of all rotations of each word.

    Parameters
    ----------
    words : array_like of int, any shape
        Words of `bits` bits, 0 to 2^bits - 1.
    bits : int
        Length of a word.

    Returns
    -------
    ndarray of int64, shape of `words`

    Examples
    --------
    >>> smallest_rotation([0b1000, 0b1010], 4)
    array([1, 5])
    """
    words = np.asarray(words, dtype=np.int64)
    smallest = words.copy()
    for turn in range(1, bits):
        np.minimum(smallest, rotated_words(words, turn, bits), out=smallest)
    return smallest


def rotated_words(words: Words, turn: int, bits: int) -> Words:
    """Return words whose sectors are rotated.

    Parameters
    ----------
    words : int or ndarray of int64, any shape
        Words of `bits` bits, 0 to 2^bits - 1.
    turn : int
        Number of sectors, 0 to `bits`, by which each bit moves to higher ones.
    bits : int
        Length of a word.

    Returns
    -------
    int or ndarray of int64, shape of `words`

    Examples
    --------
    >>> rotated_words(0b1001, 1, 4)
    3
    """
    return (words << turn | words >> (bits - turn)) & ((1 << bits) - 1)


def mirrored_words(words: np.ndarray, bits: int) -> np.ndarray:
    """Return words as they read in a mirror, in some rotation.

    Parameters
    ----------
    words : ndarray of int64, any shape
        Words of `bits` bits, 0 to 2^bits - 1.
    bits : int
        Length of a word.

    Returns
    -------
    ndarray of int64, shape of `words`

    Examples
    --------
    >>> mirrored_words(np.array([0b1011]), 6)
    array([52])
    """
    mirrored = np.zeros_like(words)
    for bit in range(bits):
        mirrored |= (words >> bit & 1) << (bits - 1 - bit)
    return mirrored
