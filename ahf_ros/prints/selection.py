"""Targets that are hard to confuse: words far apart, which no cover turns into each other.

Something in one colour over a part of a band or of a ring of dots, as dark as ink or as bright as
the ground, can turn one word into another. No detector sees a difference then. Large sets without
such conflicts are independent sets of a graph, found by local search.
"""

from collections.abc import Sequence

import numpy as np

from ahf_ros.prints.cyclic import CyclicPrint, rotated_words
from ahf_ros.prints.prints import Print

_STARTS = 4
_STEPS = 3000  # exchanges after each start
_HOPELESS = 0.7  # share of `count`, below which exchanges are not tried
_TABU = 10  # steps for which what was exchanged stays out

MAXIMUM_WORDS = 2048
"""Number of words among which a set is looked for; of more, as many are drawn at random."""


def independent_set(
    conflicts: np.ndarray, count: int, generator: np.random.Generator, thorough: bool = True
) -> np.ndarray:
    """Return the indices of a set without two elements in conflict, ascending.

    It has `count` elements, or fewer where no larger set was found. The search starts with
    elements of few conflicts and then exchanges one element for another one, until there is room
    for more (Andrade, Resende & Werneck, J. Heuristics 2012, 18, 525). `conflicts` is symmetric,
    ndarray of bool, shape (n, n), false on the diagonal. The generator decides where elements are
    equally good. Unless `thorough`, a set far from `count` is not worth the exchanges.

    Examples
    --------
    >>> ring = np.roll(np.eye(5, dtype=bool), 1, axis=1)
    >>> independent_set(ring | ring.T, 3, np.random.default_rng(0)).size
    2
    """
    best = np.empty(0, int)
    for _ in range(_STARTS):
        members = _greedy(conflicts, count, generator)
        hopeless = not thorough and members.sum() < _HOPELESS * count
        if not hopeless:
            members = _exchanged(conflicts, members, count, generator)
        best = max(best, np.flatnonzero(members)[:count], key=len)
        if hopeless or best.size == count:
            break
    return best


def _greedy(conflicts: np.ndarray, count: int, generator: np.random.Generator) -> np.ndarray:
    """Return members, each one with the fewest conflicts with what was left then."""
    degrees = conflicts.sum(axis=1).astype(np.int64)
    ties = generator.random(len(degrees))
    left = np.ones(len(degrees), bool)
    members = np.zeros(len(degrees), bool)
    while left.any() and members.sum() < count:
        chosen = np.argmin(np.where(left, degrees + ties, np.inf))
        members[chosen] = True
        removed = left & conflicts[chosen]
        removed[chosen] = True
        left &= ~removed
        degrees -= conflicts[removed].sum(axis=0)
    return members


def _exchanged(
    conflicts: np.ndarray, members: np.ndarray, count: int, generator: np.random.Generator
) -> np.ndarray:
    """Return members after exchanges of one for one, each with what then fits in."""
    best = members.copy()
    against = conflicts[members].sum(axis=0).astype(np.int64)
    barred = np.zeros(len(members), int)
    for step in range(_STEPS):
        if members.sum() > best.sum():
            best = members.copy()
        if best.sum() >= count:
            break
        outside = ~members & (barred <= step)
        free = np.flatnonzero(outside & (against == 0))
        single = free if free.size else np.flatnonzero(outside & (against == 1))
        if not single.size:
            single = np.flatnonzero(outside)
        if not single.size:
            break
        added = generator.choice(single)
        removed = np.flatnonzero(members & conflicts[added])
        members[removed] = False
        barred[removed] = step + 1 + _TABU
        against -= conflicts[removed].sum(axis=0)
        members[added] = True
        against += conflicts[added]
    return best


def select_ids(design: Print, ids: Sequence[int], count: int) -> list[int]:
    """Return `count` of different IDs of a family whose targets are hard to confuse, ascending.

    No two of their words turn into each other by a cover in one colour, and the smallest Hamming
    distance between any two, over all rotations, is as large as a search finds it. They are the
    same ones in every run. Raise a ValueError if no set of so many is found.

    Examples
    --------
    >>> from ahf_ros.prints.ring import family
    >>> ids = select_ids(family('metashape14'), range(1, 562), 20)
    >>> len(ids)
    20
    """
    generator = np.random.default_rng(0)
    pool = np.array(sorted(ids))
    if pool.size > MAXIMUM_WORDS:
        pool = np.sort(generator.choice(pool, MAXIMUM_WORDS, replace=False))
    distances = _distances(design.orbits(pool))
    confused = _confused(design, pool)
    levels = np.unique(distances[np.triu_indices(pool.size, 1)])[::-1].tolist() or [0]
    largest = 0
    for level in levels:
        conflicts = confused | (distances < level)
        np.fill_diagonal(conflicts, False)
        found = independent_set(conflicts, count, generator, level == levels[-1])
        if found.size == count:
            return [int(number) for number in pool[found]]
        largest = max(largest, found.size)
    raise ValueError(
        f'best is {count}, accepted is an integer from 1 to {largest}: no larger set of IDs of '
        f'{design.name} was found in which no target turns into another one by a cover'
    )


def _distances(orbits: np.ndarray) -> np.ndarray:
    """Return the Hamming distance between any two codes, ndarray of uint8, shape (n, n)."""
    first = orbits[:, 0]
    distances = np.full((len(first), len(first)), 64, np.uint8)
    for words in orbits.T:
        for row, word in enumerate(first):
            different = (words ^ word).view(np.uint8).reshape(-1, 8)
            counted = np.unpackbits(different, axis=1).sum(axis=1, dtype=np.uint8)
            np.minimum(distances[row], counted, out=distances[row])
    return distances


def _confused(design: Print, ids: np.ndarray) -> np.ndarray:
    """Return which pairs of ascending IDs a cover turns into each other, bool, shape (n, n).

    An ID and itself may be such a pair.
    """
    confused = np.zeros((ids.size, ids.size), bool)
    if not isinstance(design, CyclicPrint):
        return confused
    words = design.words_of(ids)
    every = design.canonical(np.arange(1 << design.bits))
    order = np.argsort(words)
    place = order[np.minimum(np.searchsorted(words, every, sorter=order), ids.size - 1)]
    index = np.where(words[place] == every, place, -1)
    rows = np.arange(ids.size)
    for length in range(1, design.bits):
        for turn in range(design.bits):
            arc = int(rotated_words((1 << length) - 1, turn, design.bits))
            for covered in (words & ~arc, words | arc):
                others = index[covered]
                confused[rows[others >= 0], others[others >= 0]] = True
    return confused | confused.T
