"""Candidates for the dots of targets, from the gradient of the logarithm of the image.

The direction of an edge says where the centre of a dot may lie: each edge pixel votes, along its
gradient, for the centres at the radii of interest (Kimme, Ballard & Sklansky, Comm. ACM 18, 1975).
On an ellipse the centre does not lie along the gradient, but in a direction that follows from it
and from the shape; so oblique dots are voted for with ellipses in several directions. An edge that
runs straight on for longer than a dot is wide belongs to no dot and does not vote, which silences
projected stripes.

Most votes are strays. Those in blocks of cells that have few do not count, but only about cells
that have enough this is looked at. Votes for different things are counted in planes of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.dots import best
from ahf_ros.vision.log_edges import LogEdges, mask_of
from ahf_ros.vision.pyramid import MAXIMUM_RADIUS

MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii and one polarity, those with most votes."""


class _Shape(NamedTuple):
    """Ellipses that are voted for."""

    aspect: float  # ratio of their axes
    directions: int  # number of directions of the major axis
    cell: int  # side of the cells in which votes are counted, px
    votes: float  # needed, for a px of the circumference of the smallest dot, as if it were round
    every: int  # one of so many edges votes


_TINY = _Shape(1.0, 1, 1, 0.6, 1)  # whose edges are the least exact
_SMALL = _Shape(1.0, 1, 1, 1.4, 1)
_LARGE = _Shape(1.0, 1, 2, 1.4, 1)
_OBLIQUE = _Shape(0.5, 6, 2, 1.2, 2)  # finds shapes of 0.4 to 0.7
_STEEP = _Shape(0.3, 8, 2, 1.2, 2)  # of 0.25 to 0.4, from 66 to 75 degrees
_RANGES = {  # by semi-major axes, px
    (3.4, 5.8): (_SMALL,),  # out of focus, as others are found on the level below
    (5.8, MAXIMUM_RADIUS): (_LARGE, _OBLIQUE, _STEEP),
}
_FIRST_RANGES = {  # of the first level
    (2.0, 3.4): (_TINY,),
    (3.4, 5.8): (_SMALL, _OBLIQUE, _STEEP),
    (5.8, MAXIMUM_RADIUS): (_LARGE, _OBLIQUE, _STEEP),
}
_STEP = 0.8  # of the radii voted for, in cells
_FLAT_PART = 0.75  # sine of the angle between an edge of an ellipse and its major axis, at most
_REACH = 0.5  # within which no other centre has more votes, in radii of the smallest dot
_CELL = 2  # in which the votes for different shapes are compared, px
_LONG = 1.5  # length of an edge that is straight, in radii of the largest dot
_SPREAD = 1.4  # votes in a cell and beside it, in weighted votes, at the least
_OWN = 1 / 8  # of the weighted votes of a peak, that its own cell has
_WEIGHTS = (0.5, 1.0, 0.5)  # of votes for the cell before, for a cell itself, and the next one
_PART = 8192  # edges that vote, or cells that are looked at, at a time, which stay in the cache
_MOST_CELLS = 2**24  # that are counted in at a time, which bounds the memory
_FIELD = 2**22  # that are compared at a time
_FLAT = 1e-6  # curvature of votes from which their top is computed


@dataclass(frozen=True, slots=True)
class Candidates:
    """Points where a dot may be, in the pixels of one level of the pyramid."""

    level: int  # pixels are 2^level wide
    points: np.ndarray  # float64, (k, 2), centres, px of the level, to about a pixel
    radii: tuple[float, float]  # smallest and largest radius of the dots, px of the level
    polarity: np.ndarray  # int, (k,), 1 for a dark dot on bright ground, -1 for a bright one


def find_candidates(
    edges: Sequence[LogEdges],
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> list[Candidates]:
    """Find the points where dots may be, for each range of radii.

    The edges are those of the pyramid from the first half on. Bounds of the radius and the
    outlines of objects that are explained already, each of shape (m, 2), are px of the image;
    edges inside do not vote. The polarities are 1 to find dark dots, -1 to find bright ones.
    """
    candidates, mask = [], None
    for level, of_level in enumerate(edges, start=1):
        ranges = {
            radii: shapes
            for radii, shapes in (_FIRST_RANGES if level == 1 else _RANGES).items()
            if radii[1] * 2**level >= min_radius and radii[0] * 2**level <= max_radius
        }
        if not ranges:
            continue
        # This is looked at only where it takes less time than to hide what is explained.
        if len(of_level.x) < len(explained) and not any(
            len(_elected(of_level, radii, shapes, polarities)[0])
            for radii, shapes in ranges.items()
        ):
            continue
        shape = of_level.marked.shape
        if mask is None:
            mask = mask_of((frame.reduced(outline, level) for outline in explained), shape)
        else:
            mask = cv2.resize(mask, shape[::-1], interpolation=cv2.INTER_NEAREST)
        rest = of_level.unmasked(mask)
        for radii, shapes in ranges.items():
            points, polarity = _elected(rest.curved(_LONG * radii[1]), radii, shapes, polarities)
            candidates.append(Candidates(level, points, radii, polarity))
    return candidates


def _elected(
    edges: LogEdges,
    radii: tuple[float, float],
    shapes: Sequence[_Shape],
    polarities: Sequence[int],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points, shape (k, 2), that enough edges vote for, and polarities, shape (k,)."""
    height, width = edges.marked.shape
    found = Peaks.joined([_peaks(edges, radii, of, polarities) for of in shapes])
    inside = (found.x > -1) & (found.x < width) & (found.y > -1) & (found.y < height)
    found = found.select(inside)
    reach = max(1, round(_REACH * radii[0] / _CELL))
    margin = reach + 1
    tall, wide = (side // _CELL + 1 + 2 * margin for side in (height, width))
    columns, rows = (
        np.rint((np.stack([found.x, found.y]) + 0.5) / _CELL - 0.5).astype(int) + margin
    )
    cells = (found.plane * tall + rows) * wide + columns
    found = found.select(highest(cells, found.votes, (len(polarities) * tall, wide), reach))
    # Spots of light may be many, of one polarity, and must not crowd out the other.
    chosen = [
        best(which, -found.votes[which], MAXIMUM_CANDIDATES, 'candidates of one size')
        for which in (np.flatnonzero(found.plane == number) for number in range(len(polarities)))
    ]
    found = found.select(np.concatenate([np.zeros(0, np.intp), *chosen]))
    return np.stack([found.x, found.y], axis=-1), np.asarray(polarities, int)[found.plane]


def _peaks(
    edges: LogEdges, radii: tuple[float, float], of: _Shape, polarities: Sequence[int]
) -> Peaks:
    """Return the points that enough edges of a shape vote for, px, with indices of polarities."""
    low, high = radii
    count = max(2, ceil((high - low) / (_STEP * of.cell)))
    steps = low + (np.arange(count) + 0.5) * (high - low) / count
    needed = of.votes * 2 * np.pi * low
    if not len(polarities) or count * len(edges.x) <= needed:
        return _NO_PEAKS
    reach = max(1, round(_REACH * low / of.cell))
    margin = reach + ceil(high / of.cell) + 1  # votes may lie outside of the image
    tall, wide = (side // of.cell + 1 + 2 * margin for side in edges.marked.shape)
    directions = np.pi * np.arange(of.directions) / of.directions
    at_once = max(1, _MOST_CELLS // (tall * wide))  # planes
    together = at_once >= len(polarities) * of.directions
    found = []
    for first, signs in enumerate([polarities] if together else [[it] for it in polarities]):
        for start in range(0, of.directions, at_once):
            # Votes for each polarity and direction are counted in a plane of their own.
            some = directions[start : start + at_once]
            shape = len(signs) * len(some), tall, wide
            votes = _votes(edges, of, some, np.outer(signs, steps), margin, shape)
            peaks = find_peaks(votes, shape, needed / of.every, reach)
            found.append(replace(peaks, plane=first + peaks.plane // len(some)))
    peaks = Peaks.joined(found)
    x, y = ((at - margin + 0.5) * of.cell - 0.5 for at in (peaks.x, peaks.y))
    return replace(peaks, x=x, y=y)


def _votes(
    edges: LogEdges,
    of: _Shape,
    directions: np.ndarray,
    radii: np.ndarray,
    margin: int,
    shape: tuple[int, int, int],
) -> Iterator[np.ndarray]:
    """Yield the cells that edges vote for, as `cells_along` does.

    Radii of shape (k, n) are signed, to vote for k polarities, with ellipses in some directions,
    in planes of a shape, with a margin of so many cells about the image.
    """
    some = edges.select(slice(None, None, of.every))
    x, y = ((at + np.float32(0.5)) / np.float32(of.cell) + margin for at in (some.x, some.y))
    steps = (radii / -of.cell).astype(np.float32)
    _, tall, wide = shape
    polarity = np.arange(len(steps)).repeat(steps.shape[1])
    for number, angle in enumerate(directions):
        start_x, start_y, unit_x, unit_y = x, y, some.unit_x, some.unit_y
        if of.aspect < 1:
            which, unit_x, unit_y = _towards_centres(some, of.aspect, angle)
            start_x, start_y = x[which], y[which]
        planes = (polarity * len(directions) + number) * (tall * wide)
        for cells in cells_along(start_x, start_y, unit_x, unit_y, steps.ravel(), wide):
            yield cells + planes[:, None]


def cells_along(
    x: np.ndarray,
    y: np.ndarray,
    unit_x: np.ndarray,
    unit_y: np.ndarray,
    steps: np.ndarray,
    wide: int,
) -> Iterator[np.ndarray]:
    """Yield the cells at n steps from k points along their directions, some points at a time.

    They are indices, (n, m), into rows of so many cells; none is before the first of its row.
    """
    steps = steps[:, None]
    for start in range(0, len(x), _PART):
        part = slice(start, start + _PART)
        columns = (x[part] + steps * unit_x[part]).astype(np.int32)
        rows = (y[part] + steps * unit_y[part]).astype(np.intp)
        yield rows * wide + columns


def _towards_centres(
    edges: LogEdges, aspect: float, angle: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the indices of edges that may be flat ones of an ellipse, and where they lie on it.

    The places are x and y, float32, from the centre of the ellipse whose semi-major axis is 1.
    """
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    along = edges.unit_x * cosine + edges.unit_y * sine
    which = np.flatnonzero(np.abs(along) < np.float32(_FLAT_PART))
    along = along[which]
    across = edges.unit_y[which] * cosine - edges.unit_x[which] * sine
    # The point of the ellipse (u / 1)^2 + (v / aspect)^2 = 1 with this normal.
    square = np.float32(aspect**2)
    scale = 1 / np.sqrt(along * along + square * across * across)
    along, across = along * scale, across * (square * scale)
    return which, along * cosine - across * sine, along * sine + across * cosine


@dataclass(frozen=True, slots=True)
class Peaks(ArrayRecord):
    """k places with more votes than their neighbourhood."""

    x: np.ndarray  # (k,), in cells; the middle of the first one of a plane is at 0
    y: np.ndarray
    plane: np.ndarray  # int, (k,)
    votes: np.ndarray  # (k,), in units of those needed


_NONE = np.zeros(0)
_NO_PEAKS = Peaks(_NONE, _NONE, _NONE.astype(int), _NONE)


def find_peaks(
    voted_for: Iterable[np.ndarray],
    shape: tuple[int, int, int],
    needed: float,
    reach: int,
) -> Peaks:
    """Return the cells with enough votes in them and beside them, and none with more within reach.

    The cells voted for are indices into all planes. The shape is the number of planes, and of rows
    and columns of each; nobody votes for those within `reach` cells of its border. Of the votes
    needed, one for a neighbouring cell counts half, and a quarter on the diagonal.
    """
    planes, tall, wide = shape
    votes = np.zeros(planes * tall * wide, np.uint16)
    for some in voted_for:
        np.add.at(votes, some.ravel(), np.uint16(1))
    cells = np.flatnonzero(votes > np.uint16(_OWN * needed))
    cells = cells[_weighted(votes, cells, wide) > needed]
    if not len(cells):
        return _NO_PEAKS
    _clear_sparse_blocks(votes, cells, wide, needed)
    cells = cells[votes[cells] > 0]
    sums = _weighted(votes, cells, wide)
    enough = sums > needed
    cells, sums = cells[enough], sums[enough]
    kept = highest(cells, sums, (planes * tall, wide), reach)
    cells, sums = cells[kept], sums[kept]
    row, column = np.divmod(cells, wide)
    plane, row = np.divmod(row, tall)
    left, right, above, below = _weighted(votes, np.add.outer((-1, 1, -wide, wide), cells), wide)
    x, y = column + _top(left, sums, right), row + _top(above, sums, below)
    return Peaks(x, y, plane.astype(int), sums / needed)


def highest(
    cells: np.ndarray, values: np.ndarray, shape: tuple[int, int], reach: int
) -> np.ndarray:
    """Return whether no value within `reach` cells is higher, for k values over 0, shape (k,).

    The cells are indices into rows and columns of a shape, row by row.
    """
    tall, wide = shape
    rows = max(_FIELD // wide, 2 * reach + 1)
    if 2 * rows < tall:
        return _highest_in_bands(cells, values, shape, reach, rows)
    field = np.zeros(tall * wide, np.float32)
    values = values.astype(np.float32)
    np.maximum.at(field, cells, values)
    which = np.arange(len(cells))
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            beside = field.take(cells[which] + (down * wide + across), mode='clip')
            which = which[values[which] >= beside]
    free = np.zeros(len(cells), bool)
    free[which] = True
    return free


def _highest_in_bands(
    cells: np.ndarray, values: np.ndarray, shape: tuple[int, int], reach: int, rows: int
) -> np.ndarray:
    """Return what `highest` does, so many rows at a time, which bounds the memory."""
    tall, wide = shape
    free = np.zeros(len(cells), bool)
    for top in range(0, tall, rows):
        first, beyond = max(top - reach, 0), min(top + rows + reach, tall)
        near = np.flatnonzero((cells >= first * wide) & (cells < beyond * wide))
        own = cells[near] - first * wide
        band = highest(own, values[near], (beyond - first, wide), reach)
        within = (own >= (top - first) * wide) & (own < (top - first + rows) * wide)
        free[near[within]] = band[within]
    return free


def _clear_sparse_blocks(votes: np.ndarray, cells: np.ndarray, wide: int, needed: float) -> None:
    """Set the votes about cells to 0 in blocks that, with some neighbours, have few.

    A block has two by two cells. A cell and its neighbours lie in two by two blocks.
    """
    sparse = []
    side = np.arange(-4, 6)  # of five blocks
    for start in range(0, len(cells), _PART):
        row, column = np.divmod(cells[start : start + _PART, None, None], wide)
        about = ((row & -2) + side[:, None]) * wide + (column & -2) + side
        about = about.clip(0, len(votes) - 1)
        of_blocks = votes[about].reshape(-1, 5, 2, 5, 2).sum(axis=(2, 4))
        enough = _of_four(np.add, of_blocks) > int(_SPREAD * needed)
        whole = _of_four(np.logical_or, enough).repeat(2, axis=1).repeat(2, axis=2)
        sparse.append(about[:, 2:-2, 2:-2][~whole])
    votes[np.concatenate(sparse)] = 0


def _of_four(joined: np.ufunc, values: np.ndarray) -> np.ndarray:
    """Return what joins two by two neighbours in arrays of values, (k, m, n), (k, m-1, n-1)."""
    rows = joined(values[:, 1:], values[:, :-1])
    return joined(rows[:, :, 1:], rows[:, :, :-1])


def _weighted(votes: np.ndarray, cells: np.ndarray, wide: int) -> np.ndarray:
    """Return the votes in cells and, with less weight, beside them, float32, shape (..., k)."""
    sums = np.zeros(cells.shape, np.float32)
    for down, of_row in zip((-wide, 0, wide), _WEIGHTS, strict=True):
        for across, of_column in zip((-1, 0, 1), _WEIGHTS, strict=True):
            beside = votes.take(cells + (down + across), mode='clip')
            sums += np.float32(of_row * of_column) * beside.astype(np.float32)
    return sums


def _top(before: np.ndarray, value: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return where the parabola through values at -1, 0 and 1 is highest, at most half a cell."""
    curvature = np.maximum(2 * value - before - after, _FLAT)
    return np.clip((after - before) / (2 * curvature), -0.5, 0.5)
