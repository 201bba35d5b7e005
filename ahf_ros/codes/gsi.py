"""Point-distributed targets, such as GSI's.

A target is a template of dots, the same on every target, and a few decoding dots on numbered
positions. The value of a code is the sum of 2^position of its decoding dots. Lengths are in the
unit of the printed design, with x to the right and y upwards as printed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from math import dist
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Rule:
    """Which combinations of positions are codes.

    Attributes
    ----------
    dots : int
        Number of decoding dots of a target.
    minimum_distance : float
        Between the centres of any two of them.
    groups : tuple of frozenset of int
        Sets of positions; a code has at least one of each set.
    first_own_number : int or None
        ID of the first code that the rule allows; None where only listed codes are codes. It is
        above the IDs of all listed codes, so that none can be taken for its vendor's.
    """

    dots: int
    minimum_distance: float = 0.0
    groups: tuple[frozenset[int], ...] = ()
    first_own_number: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PointFamily:
    """The printed design and the codes of one family of point-distributed targets.

    Attributes
    ----------
    name, unit, source : str
        Name of the family, unit of its lengths, and where the design comes from.
    dot_radius : float
        Radius of a dot that has none of its own.
    template_names : tuple of str
        Names of the template dots.
    template, positions : ndarray of float64, shape (n, 2) and (m, 2)
        Places of the template dots and of the positions.
    template_radii, position_radii : ndarray of float64, shape (n,) and (m,)
        Radii of their dots.
    reference : int
        Index of the template dot that is the target's centre.
    position_numbers : ndarray of int64, shape (m,)
        Numbers of the positions, ascending.
    rule : Rule
    words : ndarray of int64, shape (k,)
        The values of the codes, ascending and read-only.
    numbers : ndarray of int64, shape (k,)
        The ID of each.
    """

    name: str
    unit: str
    source: str
    dot_radius: float
    template_names: tuple[str, ...]
    template: np.ndarray
    template_radii: np.ndarray
    reference: int
    position_numbers: np.ndarray
    positions: np.ndarray
    position_radii: np.ndarray
    rule: Rule
    words: np.ndarray
    numbers: np.ndarray

    def number(self, word: int) -> int | None:
        """Return the ID of a value; None where the family does not have it."""
        index = int(np.searchsorted(self.words, word))
        if index < self.words.size and self.words[index] == word:
            return int(self.numbers[index])
        return None

    def word(self, number: int) -> int:
        """Return the value of the code with an ID.

        Raises
        ------
        ValueError
            If the family has no such ID.
        """
        found = np.flatnonzero(self.numbers == number)
        if not found.size:
            raise ValueError(
                f'number is {number!r}, accepted is one of the {self.numbers.size} IDs of '
                f'{self.name}, from {self.numbers.min()} to {self.numbers.max()}'
            )
        return int(self.words[found[0]])

    def decoding_dots(self, word: int) -> np.ndarray:
        """Return the indices of the positions that have a dot, ndarray of int."""
        return np.flatnonzero(np.int64(word) >> self.position_numbers & 1)

    def dots(self, word: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the places of all dots of a value, relative to the centre, and their radii."""
        count = len(self.template)
        shown = np.r_[:count, count + self.decoding_dots(word)]
        return self.places[shown], self.radii[shown]

    @property
    def listed(self) -> dict[int, int]:
        """The values of the codes that the library lists, by ID."""
        first = self.rule.first_own_number
        pairs = zip(self.numbers.tolist(), self.words.tolist(), strict=True)
        return {number: word for number, word in pairs if first is None or number < first}

    @property
    def places(self) -> np.ndarray:
        """Places of the template dots, then of the positions, relative to the centre."""
        every = np.concatenate([self.template, self.positions])
        centred: np.ndarray = every - self.template[self.reference]
        return centred

    @property
    def radii(self) -> np.ndarray:
        """Radii of the dots at `places`."""
        return np.concatenate([self.template_radii, self.position_radii])

    @property
    def reach(self) -> float:
        """Radius of the circle about the centre that holds every dot there may be."""
        return float((np.hypot(*self.places.T) + self.radii).max())


def value_of(positions: Iterable[int]) -> int:
    """Return the sum of 2^position.

    Examples
    --------
    >>> value_of((4, 6, 14))
    16464
    """
    return sum(1 << position for position in positions)


def valid_words(places: Mapping[int, tuple[float, float]], rule: Rule) -> np.ndarray:
    """Return the values that a rule allows, ndarray of int64, ascending.

    Parameters
    ----------
    places : mapping of int to tuple of 2 float
        Places of the positions by their numbers.
    rule : Rule
    """
    words = [
        value_of(combination)
        for combination in combinations(sorted(places), rule.dots)
        if all(group & set(combination) for group in rule.groups)
        and far_apart([places[number] for number in combination], rule.minimum_distance)
    ]
    return np.array(sorted(words), np.int64)


def positions_of(value: int) -> list[int]:
    """Return the positions whose 2^position a value is the sum of, ascending."""
    return [bit for bit in range(value.bit_length()) if value >> bit & 1]


def far_apart(points: Any, minimum_distance: float) -> bool:
    """Return whether any two of the points, shape (n, 2), are at least that far apart."""
    return all(
        dist(first, second) >= minimum_distance - 1e-9 for first, second in combinations(points, 2)
    )
