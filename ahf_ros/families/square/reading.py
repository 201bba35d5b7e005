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
from math import log

import cv2
import numpy as np

from ahf_ros.families.square.frames import side_lengths, square_frames
from ahf_ros.families.square.shapes import corner_odds, parallel_odds
from ahf_ros.families.words import against as of_expected
from ahf_ros.prints.square import borders, corner_counts, words
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.frame import project
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.sampling import sample

_IN_CELL = ((0.0, 0.0), (-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2))
"""Where a cell is sampled, from its centre, in cells."""

_CORNER = 0.3  # from a corner of the border, in cells
_OUTERMOST = (1, 3, 2, 4)  # of the whole cell and its parts, those at the corners
_BLURS = 0.7, 0.4  # of a usual image and of a sharp one, standard deviations in px
_SMALL_CELL = 2.0  # below which they differ, px
_SMALLEST_CELL = 1.0  # that can be read, px
_LARGE_CELL = 4.0  # whose middle stays dark where light spreads over ink, px
_SPREADS = 3.0  # logarithmic odds against an image in which it does
_MOST_MIXED = 0.2  # share that a cell takes from each neighbour, at most
_REACH = 0.25  # standard deviation of the window that levels are taken from, in sides
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
    paper: np.ndarray  # (k, c), by how much the log odds of a marker grow where a cell is paper
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
    prints, prior, few, drawn = _table(group)
    odds = seen.paper @ prints
    odds -= prior
    if expected:
        odds -= np.repeat(of_expected(np.arange(len(prior) // 4), expected), 4)
    best = odds.argmax(axis=1)
    of_cells = odds[np.arange(len(best)), best] + seen.ink - _DOUBT - few[best]
    of_shape = seen.square + drawn[best] - prior[best] - _FIGURES
    total = -np.logaddexp(-of_cells, -of_shape)
    likely = np.flatnonzero((total > _POSSIBLE) | everything & seen.whole)
    odds, best = odds[likely], best[likely]
    # A turn of the same marker is no other: some are symmetric.
    number, turn = np.divmod(best, 4)
    rows = np.arange(len(best))[:, None]
    odds -= odds[rows, best[:, None]]
    odds[rows, 4 * number[:, None] + np.arange(4)] = -np.inf
    second = odds.max(axis=1, initial=-np.inf)
    return Readings(
        corners=corners[seen.quadrilateral[likely, None], (np.arange(4) - turn[:, None]) % 4],
        group=np.full(len(best), index),
        number=number,
        border=np.full(len(best), border),
        odds=total[likely],
        others=second + np.log(np.exp(odds - second[:, None]).sum(axis=1)),
        whole=seen.whole[likely],
    )


@lru_cache(maxsize=32)
def _table(group: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the cells of the markers of dictionaries in four turns, and three terms for each.

    Other markers speak against it, and textures, which have few edges between cells. The third
    term is the logarithmic odds against a figure that has just its corners, each at one of the
    lines between cells. The shapes are (cells, 4 n) and thrice (4 n,).
    """
    cells = words(group[-1])
    turned = np.stack([np.rot90(cells, turn, axes=(1, 2)) for turn in range(4)], axis=1)
    count = np.zeros(len(cells))
    for name in reversed(group):
        count[: len(words(name))] = 4 * len(words(name))
    bordered = np.pad(cells, ((0, 0), (1, 1), (1, 1)))
    edges = sum(np.diff(bordered, axis=axis).sum(axis=(1, 2)) for axis in (1, 2))
    usual = cells.shape[1] * (cells.shape[1] + 1)
    return (
        turned.reshape(4 * len(cells), -1).T.astype(np.float32),
        np.log(np.repeat(count, 4)).astype(np.float32),
        np.repeat(_PLAIN * np.maximum(usual - edges, 0), 4),
        np.repeat(corner_counts(group[-1]) * log(cells.shape[1] + 1), 4),
    )


def _dark_inside(gray: np.ndarray, frames: np.ndarray, depth: float) -> np.ndarray:
    """Return whether quadrilaterals are dark inside all sides, bright outside, shape (k,).

    The depth inside is a share of a side.
    """
    along = np.linspace(-0.45, 0.45, _POINTS)
    turns = [np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), turn) for turn in range(4)]

    def logs(across: float) -> np.ndarray:
        side = np.stack([along, np.full(_POINTS, across)], axis=1)
        points = project(frames, np.stack([side @ turn for turn in turns]))
        values = sample(gray, points.reshape(len(frames), -1, 2))
        return np.log(values + LOG_OFFSET).reshape(-1, 4, _POINTS)

    if not len(frames):
        return np.zeros(0, bool)
    dark = logs(-0.5 - _DEPTH) - logs(-0.5 + depth) > _MINIMUM_STEP / 2
    return dark.mean(axis=2).min(axis=1) >= _SIDE


def _evidence(
    gray: np.ndarray,
    frames: np.ndarray,
    corners: np.ndarray,
    sizes: np.ndarray,
    cells: int,
    border: int,
) -> _Evidence:
    """Return what the cells of quadrilaterals within a border say.

    Those with small cells are there twice, once as in a sharp image, and those with large cells
    once by the darkest part of each, as where light has spread from paper over ink.
    """
    side = cells + 2 * border
    places = (np.arange(side + 2) - (side + 1) / 2) / side
    grid = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
    points = project(frames, grid + np.array(_IN_CELL)[:, None] / side)
    parts = sample(gray, points).astype(np.float64).swapaxes(0, 1)
    parts = parts.reshape(len(_IN_CELL), len(frames), side + 2, side + 2)
    small = np.flatnonzero(sizes < _SMALL_CELL * side)
    large = np.flatnonzero(sizes >= _LARGE_CELL * side)
    tried = np.concatenate([np.arange(len(frames)), small, large])
    blurs, spreads = np.repeat(
        [[*_BLURS, _BLURS[0]], [0.0, 0.0, _SPREADS]], [len(frames), len(small), len(large)], axis=1
    )
    darkest, parts = parts.min(axis=0), parts[1:]
    whole = parts.mean(axis=0)[tried]
    whole[spreads > 0] = darkest[large]
    whole = _unmixed(whole, corners[tried], side, blurs)
    logs = np.log(parts + LOG_OFFSET).reshape(len(parts), len(frames), -1)[:, tried]
    values = np.log(np.maximum(whole, 0) + LOG_OFFSET)
    rings = _rings(cells, border)
    flat = values.reshape(len(values), -1)
    ink, paper = flat[:, rings.ink], flat[:, rings.paper]
    steps = paper - ink
    usual = np.median(steps, axis=1)[:, None]
    clear = (steps > _OF_USUAL * usual) & (steps > _MINIMUM_STEP / 2)
    on_sides = clear.reshape(len(clear), 4, side).mean(axis=2).min(axis=1, initial=1.0)
    which = np.flatnonzero((usual[:, 0] > _MINIMUM_STEP) & (on_sides >= _SIDE))
    ink, paper, clear = ink[which], paper[which], clear[which]
    total = clear @ rings.weights
    middle = (clear * (ink + paper) / 2) @ rings.weights / total
    step = (clear * (paper - ink)) @ rings.weights / total
    levels = np.concatenate([flat[None, which], logs[:, which]])
    odds = np.clip(_SHARPNESS * (levels - middle) / step, -_COVERED, _COVERED)
    weights = np.array([1.0, *[_PART_WEIGHT] * len(parts)])
    against = np.einsum('p,pkc->kc', weights, log(2) - np.logaddexp(0, odds))
    against -= _UNCLEAR * (1 - np.abs(odds[0]) / _COVERED)
    around = _BORDER_WEIGHT * against[:, rings.border].sum(axis=1)
    around += _CORNER_WEIGHT * against[:, rings.corners].sum(axis=1)
    paper = np.einsum('p,pkc->kc', weights, odds)[:, rings.inside]
    inside = against[:, rings.inside].sum(axis=1) + around
    middle, step = middle[:, rings.corners], step[:, rings.corners]
    outermost = levels[_OUTERMOST, :, rings.corners].T
    bright = (np.exp(outermost - middle) - np.exp(-step / 2)) / (2 * np.sinh(step / 2))
    depths = _CORNER * _cell_sizes(corners[tried[which]], side) / blurs[which, None]
    square = np.clip(corner_odds(bright, depths, _SHARPNESS), -_COVERED, _COVERED).sum(axis=1)
    rare = spreads[which]
    whole = (around > _WHOLE) & (square > 0)
    paper = paper.astype(np.float32)
    return _Evidence(tried[which], paper, inside - rare, square - rare, whole)


@dataclass(frozen=True, slots=True)
class _Rings:
    ink: np.ndarray  # (4 m,), outermost cells of the border, side by side
    paper: np.ndarray  # (4 m,), the cells beside them
    border: np.ndarray  # the cells of the border, each once
    corners: np.ndarray  # those at the corners, which round and tattered regions do not have
    inside: np.ndarray  # the other cells
    weights: np.ndarray  # (4 m, n), of the cells of the border for the levels of all cells


@lru_cache
def _rings(cells: int, border: int) -> _Rings:
    """Return the indices of cells in the grid of a marker, border and one more ring included."""
    size = cells + 2 * border + 2
    index = np.arange(size**2).reshape(size, size)
    turned = [np.rot90(index, turn) for turn in range(4)]
    ink = np.concatenate([of[1, 1:-1] for of in turned])
    paper = np.concatenate([of[0, 1:-1] for of in turned])
    rows, columns = np.divmod(index.ravel(), size)
    squares = np.subtract.outer(rows[ink], rows) ** 2.0
    squares += np.subtract.outer(columns[ink], columns) ** 2.0
    weights = np.exp(-squares / (2 * (_REACH * size) ** 2)) + 1e-6
    corners = index[[1, 1, -2, -2], [1, -2, 1, -2]]
    inside = index[border + 1 : -border - 1, border + 1 : -border - 1].ravel()
    around = np.setdiff1d(index[1:-1, 1:-1], inside)
    return _Rings(ink, paper, around, corners, inside, weights)


def _cell_sizes(corners: np.ndarray, side: int) -> np.ndarray:
    """Return the width and the height of cells, mean of opposite sides, px, shape (k, 2)."""
    lengths = side_lengths(corners) / side
    return (lengths[:, :2] + lengths[:, 2:]) / 2


def _unmixed(values: np.ndarray, corners: np.ndarray, side: int, blurs: np.ndarray) -> np.ndarray:
    """Return the gray values of cells, shape (k, n, n), without what blurs mixed into them."""
    count = values.shape[1]
    neighbours = np.eye(count, k=1) + np.eye(count, k=-1)
    neighbours[0, 0] = neighbours[-1, -1] = 1
    across, down = (normal_integral(-of / blurs / 2) for of in _cell_sizes(corners, side).T)
    mixed = [
        np.eye(count)
        + np.minimum(of, _MOST_MIXED)[:, None, None] * (neighbours - 2 * np.eye(count))
        for of in (across, down)
    ]
    along_columns = np.linalg.solve(mixed[1], values)
    return np.linalg.solve(mixed[0], along_columns.transpose(0, 2, 1)).transpose(0, 2, 1)
