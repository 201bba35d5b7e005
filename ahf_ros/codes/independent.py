"""Large sets without conflicts: independent sets of a graph, by local search."""

from __future__ import annotations

import numpy as np

_STARTS = 4
_STEPS = 3000  # exchanges after each start
_HOPELESS = 0.7  # share of `count`, below which exchanges are not tried
_TABU = 10  # steps for which what was exchanged stays out


def independent_set(
    conflicts: np.ndarray, count: int, generator: np.random.Generator, thorough: bool = True
) -> np.ndarray:
    """Return a set without two elements in conflict, of `count` elements where one is found.

    The search starts with elements of few conflicts and then exchanges one element for another
    one, until there is room for more (Andrade, Resende & Werneck, J. Heuristics 2012, 18, 525).

    Parameters
    ----------
    conflicts : ndarray of bool, shape (n, n)
        Symmetric, false on the diagonal.
    count : int
        Number of elements that are enough.
    generator : numpy.random.Generator
        Decides where elements are equally good.
    thorough : bool
        Whether a set far from `count` is worth the exchanges, too.

    Returns
    -------
    ndarray of int, shape (m,)
        Indices, ascending; m is at most `count`, and less where no larger set was found.

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
    members = members.copy()
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
