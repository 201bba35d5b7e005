"""Reading of square markers: evidence that a quadrilateral has the cells of a marker.

What speaks for a marker is compared with what any other cells would have done, and with what else
has the same cells: a figure with few corners, such as a letter, is as likely as its description is
short [1]_, and differs by the shape of its frame only. Steps between cells are seen in any light;
where a border shows that light is even, the levels of cells say as much of soft and small ones.

References
----------
.. [1] Rissanen, Modeling by shortest data description, Automatica 14(5), 1978, 465-471.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, log

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.square.evidence import MINIMUM_STEP, SIDE, Evidence
from ahf_ros.families.square.frames import square_frames
from ahf_ros.families.square.levels import levels_of_cells
from ahf_ros.families.square.shapes import parallel_odds
from ahf_ros.families.square.steps import stepped, steps_between_cells
from ahf_ros.families.words import against as of_expected
from ahf_ros.prints.square import borders, corner_counts, words
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.logarithm import LOG_OFFSET

_POINTS, _DEPTH = 10, 0.06  # of each side where a border is looked for, distance in sides
_DOUBT = 6.0  # logarithmic odds against a marker that nothing but a quadrilateral speaks for
_FIGURES = 7.0  # logarithmic odds of letters and the like against markers
_POSSIBLE = -12.0  # minimum of these odds where all is as usual but a corner or the blur
_CLEAR = -6.0  # maximum of the odds of other markers where these odds are low
_PLAIN = 0.35  # logarithmic odds against a marker, for each edge less than random cells have

_Features = Callable[[np.ndarray], np.ndarray]
"""From the cells of words to what evidence is of."""

MINIMUM_ODDS = 2.2
"""Logarithmic odds of a marker that is reported: nine to one."""


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """Markers that quadrilaterals were read as; all but corners of shape (k,)."""

    corners: np.ndarray  # (k, 4, 2), px, from the one that is top left in the upright marker
    group: np.ndarray  # of dictionaries, its index
    number: np.ndarray  # ID
    border: np.ndarray  # width of the border, cells
    odds: np.ndarray  # logarithmic, that it is a marker of the group, if the group is there
    others: np.ndarray  # logarithmic odds of other markers of the group against this one
    whole: np.ndarray  # whether its border is one of a marker, whatever is inside


NOTHING = Readings(
    corners=np.zeros((0, 4, 2)),
    group=np.zeros(0, int),
    number=np.zeros(0, int),
    border=np.zeros(0, int),
    odds=np.zeros(0),
    others=np.zeros(0),
    whole=np.zeros(0, bool),
)


def read(
    gray: np.ndarray,
    corners: np.ndarray,
    groups: Sequence[Sequence[str]],
    expected: frozenset[int] = frozenset(),
    *,
    everything: bool = False,
) -> Readings:
    """Read quadrilaterals, shape (k, 4, 2), px, of an image of uint8 as markers of dictionaries.

    A group has dictionaries that begin with the same markers, the smallest first. `expected` are
    IDs that are likely to be there; empty: all IDs are equally likely. Those with a whole border
    that are like none of the markers are among them if `everything` is asked for.
    """
    found = [NOTHING]
    groups = groups if len(corners) else ()
    frames = square_frames(corners)
    bordered = np.flatnonzero(_dark_inside(gray, frames, _DEPTH))
    parallel = parallel_odds(frames, max(gray.shape))
    grids = [
        {(words(group[0]).shape[1], border) for border in borders(group[0])} for group in groups
    ]
    for cells, border in sorted(set().union(*grids)):
        some = bordered
        if border > 1:
            innermost = (border - 0.5) / (cells + 2 * border)
            some = some[_dark_inside(gray, frames[some], innermost)]
        if not len(some):
            continue
        for seen, features in _seen(gray, frames[some], corners[some], cells, border):
            if not len(seen.quadrilateral):
                continue
            which = some[seen.quadrilateral]
            seen = replace(seen, quadrilateral=which, square=seen.square + parallel[which])
            found += [
                _likely(seen, features, corners, group, index, border, expected, everything)
                for index, group in enumerate(map(tuple, groups))
                if (cells, border) in grids[index]
            ]
    readings = Readings.joined(found)
    shown = (readings.odds > MINIMUM_ODDS) | (readings.others < _CLEAR)
    return readings.select(shown | everything & readings.whole)


def _seen(
    gray: np.ndarray,
    frames: np.ndarray,
    corners: np.ndarray,
    cells: int,
    border: int,
) -> Iterator[tuple[Evidence, _Features]]:
    """Yield what quadrilaterals say within a border, with what the features of words are."""
    steps, even = steps_between_cells(gray, frames, corners, cells, border)
    which = np.flatnonzero(even)
    if len(which):
        levels = levels_of_cells(gray, frames[which], corners[which], cells, border)
        yield replace(levels, quadrilateral=which[levels.quadrilateral]), _as_they_are
    yield steps, stepped


def _as_they_are(cells: np.ndarray) -> np.ndarray:
    """Return cells (..., n, n) as features (..., n n)."""
    return cells.reshape(*cells.shape[:-2], -1)


def _likely(
    seen: Evidence,
    features: _Features,
    corners: np.ndarray,
    group: tuple[str, ...],
    index: int,
    border: int,
    expected: frozenset[int],
    everything: bool,
) -> Readings:
    """Return what is likely to be a marker of a group, whose index and border are given."""
    prior, few, shapes = _terms(group)
    prior = prior + of_expected(np.arange(len(prior)), expected)
    of_words = _bits(group, features), prior, few, shapes, _DOUBT, _FIGURES, _POSSIBLE
    best, total, others, likely, *_ = kernels.likeliest_words(
        seen.features, seen.ink, seen.square, everything & seen.whole, *of_words
    )
    number, turn = best[likely].T
    return Readings(
        corners=corners[seen.quadrilateral[likely, None], (np.arange(4) - turn[:, None]) % 4],
        group=np.full(len(number), index),
        number=number,
        border=np.full(len(number), border),
        odds=total[likely],
        others=others[likely],
        whole=seen.whole[likely],
    )


@lru_cache(maxsize=64)
def _bits(group: tuple[str, ...], features: _Features) -> np.ndarray:
    """Return the features of the markers of dictionaries in four turns, shape (bytes, n, 4)."""
    cells = words(group[-1])
    turned = np.stack([np.rot90(cells, turn, axes=(1, 2)) for turn in range(4)], axis=1)
    bits = np.packbits(features(turned), axis=2, bitorder='little')
    return np.ascontiguousarray(np.moveaxis(bits, 2, 0))


@lru_cache(maxsize=32)
def _terms(group: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return three terms for each marker of dictionaries, shape (n,).

    Other markers speak against it, and textures, which have few edges between cells. The third
    term is the logarithmic odds against a figure that has just its corners, each at one of the
    lines between cells, less the first one.
    """
    cells = words(group[-1])
    count = np.zeros(len(cells))
    for name in reversed(group):
        count[: len(words(name))] = 4 * len(words(name))
    bordered = np.pad(cells, ((0, 0), (1, 1), (1, 1)))
    edges = sum(np.diff(bordered, axis=axis).sum(axis=(1, 2)) for axis in (1, 2))
    usual = cells.shape[1] * (cells.shape[1] + 1)
    others = np.log(count)
    shapes = corner_counts(group[-1]) * log(cells.shape[1] + 1) - others
    return others, _PLAIN * np.maximum(usual - edges, 0), shapes


def _dark_inside(gray: np.ndarray, frames: np.ndarray, depth: float) -> np.ndarray:
    """Return whether quadrilaterals are dark inside all sides, bright outside, shape (k,).

    The depth inside is a share of a side.
    """
    places = np.linspace(-0.45, 0.45, _POINTS), 0.5 + _DEPTH, 0.5 - depth
    numbers = LOG_OFFSET, exp(MINIMUM_STEP / 2), SIDE
    dark: np.ndarray = kernels.dark_inside(gray, frames, *places, *numbers)
    return dark
