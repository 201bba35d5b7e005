"""Families of code words that are read round a circle, so that turned words are one code."""

from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np

from ahf_ros.prints.prints import Print

Words = TypeVar('Words', int, np.ndarray)


@dataclass(frozen=True, slots=True, eq=False)
class CyclicPrint(Print):
    """Code words of `bits` bits, and their IDs, which are above 0.

    `words` has the canonical ones, ndarray of int64, shape (n,), ascending; `numbers` are their
    IDs. Both are read-only.
    """

    has_pinhole: ClassVar[bool] = True
    direction: ClassVar[str]  # in which words are read

    name: str
    bits: int
    words: np.ndarray
    numbers: np.ndarray

    @property
    def reading(self) -> dict[str, int | str]:
        """How words are read."""
        return {'bits': self.bits, 'first_bit': 'lowest', 'direction': self.direction}

    def canonical(self, words: Any) -> np.ndarray:
        """Return the smallest of all words that are the same code, ndarray of int64."""
        return smallest_rotation(words, self.bits)

    def has(self, codes: np.ndarray) -> np.ndarray:
        """Return whether canonical words are among these, ndarray of bool."""
        index = np.minimum(np.searchsorted(self.words, codes), self.words.size - 1)
        return np.asarray(self.words[index] == codes)

    def ids(self, words: Any) -> np.ndarray:
        """Return the IDs of words wherever their reading begins, 0 where there is none."""
        codes = self.canonical(words)
        index = np.minimum(np.searchsorted(self.words, codes), self.words.size - 1)
        return np.where(self.words[index] == codes, self.numbers[index], 0)

    def number(self, word: int) -> int | None:
        """Return the ID of `word` wherever its reading begins; None where there is none."""
        if not 0 <= word < 1 << self.bits:
            return None
        return int(self.ids(word)) or None

    def word(self, number: int) -> int:
        """Return the canonical code word of an ID; raise a ValueError if there is none."""
        if number not in self.numbers:
            raise ValueError(
                f'number is {number!r}, accepted is an ID of {self.name} from '
                f'{self.numbers.min()} to {self.numbers.max()}'
            )
        return int(self.words_of(np.array([number]))[0])

    def words_of(self, numbers: np.ndarray) -> np.ndarray:
        """Return the canonical code words of IDs, each one of the family."""
        order = np.argsort(self.numbers)
        return self.words[order[np.searchsorted(self.numbers, numbers, sorter=order)]]

    def orbits(self, numbers: np.ndarray) -> np.ndarray:
        """Return all rotations of the word of each ID, ndarray of uint64, shape (n, k)."""
        words = self.words_of(numbers)
        turned = [rotated_words(words, turn, self.bits) for turn in range(self.bits)]
        return np.stack(turned, axis=1).astype(np.uint64)


def smallest_rotation(words: Any, bits: int) -> np.ndarray:
    """Return the smallest of all rotations of each word of `bits` bits, ndarray of int64.

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
    """Return words of `bits` bits, each bit of which moves by `turn` sectors to higher ones.

    Examples
    --------
    >>> rotated_words(0b1001, 1, 4)
    3
    """
    return (words << turn | words >> (bits - turn)) & ((1 << bits) - 1)


def mirrored_words(words: Words, bits: int) -> Words:
    """Return words of `bits` bits as they read in a mirror, in some rotation.

    Examples
    --------
    >>> f'{mirrored_words(0b1011, 6):06b}'
    '110100'
    """
    mirrored = words & 0
    for bit in range(bits):
        mirrored = mirrored << 1 | (words >> bit & 1)
    return mirrored
