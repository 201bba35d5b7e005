"""Reading of square markers: evidence that a quadrilateral has the cells of a marker.

All cells of the grid that a dictionary has are sampled, those of the border and one more around
it with them. Ink and paper next to each other in these two rings tell what ink and paper are in
the light of each cell. A cell speaks for paper by where it is between these levels, but never by
more than it would if it may be covered. What speaks for a marker is compared with what any other
cells would have done, and with what else has the same cells: a figure with few corners, such as a
letter, is as likely as its description is short [1]_, and differs by the shape of its frame only.

References
----------
.. [1] Rissanen, Modeling by shortest data description, Automatica 14(5), 1978, 465-471.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, log

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.families.square.frames import side_lengths, square_frames
from ahf_ros.families.square.shapes import parallel_odds
from ahf_ros.families.words import against as of_expected
from ahf_ros.prints.square import borders, corner_counts, words
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.logarithm import LOG_OFFSET

_IN_CELL = ((0.0, 0.0), (-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2))
"""Where a cell is sampled, from its centre, in cells."""

_CORNER = 0.3  # from a corner of the border, in cells
_BLURS = 0.7, 0.4  # of a usual image and of a sharp one, standard deviations in px
_SMALL_CELL = 2.0  # below which they differ, px
_SMALLEST_CELL = 1.0  # that can be read, px
_UNUSUAL = 3.0  # log odds against light that spreads over ink, or changes within a marker
_MOST_MIXED = 0.2  # share that a cell takes from each neighbour, at most
_REACH = 0.25  # standard deviation of the window that levels are taken from, in sides
_EVERYWHERE = 1e-6  # weight of all others, if there is none in this window
_MINIMUM_STEP = 0.35  # from ink to paper, in the logarithm
_OF_USUAL = 0.4  # minimum of a step of the border, in usual ones
_SIDE = 0.6  # minimum share of such steps of each side of the border
_POINTS, _DEPTH = 10, 0.06  # of each side where a border is looked for, distance in sides
_SHARPNESS = 12.0  # of a cell: its logarithmic odds, by its distance from the middle in steps
_COVERED = 3.0  # maximum of these odds, as a cell may be covered
_UNCLEAR = 1.5  # logarithmic odds against a cell that is between ink and paper
_PART_WEIGHT = 0.15  # of each part of a cell, which have one colour in other quadrilaterals, too
_BORDER_WEIGHT = 0.3  # of the cells of the border, which are alike in other quadrilaterals, too
_CORNER_WEIGHT = 0.7
_DOUBT = 6.0  # logarithmic odds against a marker that nothing but a quadrilateral speaks for
_FIGURES = 7.0  # logarithmic odds of letters and the like against markers
_POSSIBLE = -12.0  # minimum of these odds where all is as usual but a corner or the blur
_CLEAR = -6.0  # maximum of the odds of other markers where these odds are low
_WHOLE = -1.0  # logarithmic odds of the cells of a border, from which it is whole
_PLAIN = 0.35  # logarithmic odds against a marker, for each edge less than random cells have

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


@dataclass(frozen=True, slots=True)
class _Evidence:
    """What the cells of quadrilaterals within a border say; k of these, c cells in each."""

    quadrilateral: np.ndarray  # (k,), its index
    paper: (
        np.ndarray
    )  # float32, (k, c), by how much the log odds of a marker grow where a cell is paper
    ink: np.ndarray  # (k,), logarithmic odds of a marker where all cells are ink
    square: np.ndarray  # (k,), logarithmic odds of square corners
    whole: np.ndarray  # (k,), whether the border is whole, bool


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
    sizes = np.sqrt([cv2.contourArea(of.astype(np.float32)) for of in corners])
    grids = [
        {(words(group[0]).shape[1], border) for border in borders(group[0])} for group in groups
    ]
    for cells, border in sorted(set().union(*grids)):
        some = bordered[sizes[bordered] >= _SMALLEST_CELL * (cells + 2 * border)]
        if border > 1:
            innermost = (border - 0.5) / (cells + 2 * border)
            some = some[_dark_inside(gray, frames[some], innermost)]
        if not len(some):
            continue
        places = frames[some], corners[some], sizes[some]
        seen = _evidence(gray, *places, cells, border)
        if not len(seen.quadrilateral):
            continue
        which = some[seen.quadrilateral]
        seen = replace(seen, quadrilateral=which, square=seen.square + parallel[which])
        found += [
            _likely(seen, corners, tuple(group), index, border, expected, everything=everything)
            for index, group in enumerate(groups)
            if (cells, border) in grids[index]
        ]
    readings = Readings.joined(found)
    shown = (readings.odds > MINIMUM_ODDS) | (readings.others < _CLEAR)
    return readings.select(shown | everything & readings.whole)


def _likely(
    seen: _Evidence,
    corners: np.ndarray,
    group: tuple[str, ...],
    index: int,
    border: int,
    expected: frozenset[int],
    *,
    everything: bool,
) -> Readings:
    """Return what is likely to be a marker of a group, whose index and border are given."""
    bits, prior, few, shapes = _table(group)
    prior = prior + of_expected(np.arange(len(prior)), expected)
    of_words = bits, prior, few, shapes, _DOUBT, _FIGURES, _POSSIBLE
    best, total, others, likely, *_ = kernels.likeliest_words(
        seen.paper, seen.ink, seen.square, everything & seen.whole, *of_words
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


@lru_cache(maxsize=32)
def _table(group: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the bits of the markers of dictionaries in four turns, and three terms for each.

    Other markers speak against it, and textures, which have few edges between cells. The third
    term is the logarithmic odds against a figure that has just its corners, each at one of the
    lines between cells, less the first one. The shapes are (bytes, n, 4) and thrice (n,).
    """
    cells = words(group[-1])
    turned = np.stack([np.rot90(cells, turn, axes=(1, 2)) for turn in range(4)], axis=1)
    count = np.zeros(len(cells))
    for name in reversed(group):
        count[: len(words(name))] = 4 * len(words(name))
    bordered = np.pad(cells, ((0, 0), (1, 1), (1, 1)))
    edges = sum(np.diff(bordered, axis=axis).sum(axis=(1, 2)) for axis in (1, 2))
    usual = cells.shape[1] * (cells.shape[1] + 1)
    others = np.log(count)
    shapes = corner_counts(group[-1]) * log(cells.shape[1] + 1) - others
    few = _PLAIN * np.maximum(usual - edges, 0)
    bits = np.packbits(turned.reshape(*turned.shape[:2], -1), axis=2, bitorder='little')
    return np.ascontiguousarray(np.moveaxis(bits, 2, 0)), others, few, shapes


def _dark_inside(gray: np.ndarray, frames: np.ndarray, depth: float) -> np.ndarray:
    """Return whether quadrilaterals are dark inside all sides, bright outside, shape (k,).

    The depth inside is a share of a side.
    """
    places = np.linspace(-0.45, 0.45, _POINTS), 0.5 + _DEPTH, 0.5 - depth
    numbers = LOG_OFFSET, exp(_MINIMUM_STEP / 2), _SIDE
    dark: np.ndarray = kernels.dark_inside(gray, frames, *places, *numbers)
    return dark


def _evidence(
    gray: np.ndarray,
    frames: np.ndarray,
    corners: np.ndarray,
    sizes: np.ndarray,
    cells: int,
    border: int,
) -> _Evidence:
    """Return what the cells of quadrilaterals within a border say.

    All are there twice, once by the darkest part of each cell, as where light has spread from
    paper over ink; those with small cells once more, as in a sharp image.
    """
    side = cells + 2 * border
    small = np.flatnonzero(sizes < _SMALL_CELL * side)
    every = np.arange(len(frames))
    tried = np.concatenate([every, small])
    counts = len(every), len(small)
    blurs, spread = np.repeat(_BLURS, counts), np.repeat([True, False], counts)
    lengths = side_lengths(corners[tried]) / side
    reach = (np.arange(side + 2) / (_REACH * (side + 2))) ** 2
    of_levels = LOG_OFFSET, _MOST_MIXED, _MINIMUM_STEP, _OF_USUAL, _SIDE, _EVERYWHERE
    weights = np.array([_PART_WEIGHT, _BORDER_WEIGHT, _CORNER_WEIGHT])
    seen, paper, (ink, square, around), *_ = kernels.cell_evidence(
        gray,
        frames[tried],
        (lengths[:, :2] + lengths[:, 2:]) / 2,
        blurs,
        spread,
        kernels.exponentials(-reach / 2),
        np.array(_IN_CELL),
        *of_levels,
        _SHARPNESS,
        _COVERED,
        _UNCLEAR,
        _UNUSUAL,
        weights,
        _CORNER,
        n=cells,
    )
    which = np.flatnonzero(seen)
    ink, square, around = (of.ravel()[which] for of in (ink, square, around))
    return _Evidence(
        tried[which % len(tried)],
        paper.reshape(-1, cells**2)[which],
        ink,
        square,
        (around > _WHOLE) & (square > 0),
    )
