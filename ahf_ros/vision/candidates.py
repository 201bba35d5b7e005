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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros import kernels
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
REACH = 0.5  # within which no other centre has more votes, in radii of the smallest dot
_CELL = 2  # in which the votes for different shapes are compared, px
_LONG = 1.5  # length of an edge that is straight, in radii of the largest dot
_SPREAD = 1.4  # votes in a cell and beside it, in weighted votes, at the least
_OWN = 1 / 8  # of the weighted votes of a peak, that its own cell has
_MOST_CELLS = 2**24  # that are counted in at a time, which bounds the memory
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
    reach = max(1, round(REACH * radii[0] / _CELL))
    margin = reach + 1
    tall, wide = (side // _CELL + 1 + 2 * margin for side in (height, width))
    columns, rows = (
        np.rint((np.stack([found.x, found.y]) + 0.5) / _CELL - 0.5).astype(int) + margin
    )
    cells = (found.plane * tall + rows) * wide + columns
    order = np.argsort(cells, kind='stable')
    kept = np.zeros(len(cells), bool)
    kept[order] = kernels.highest_cells(cells[order], found.votes[order], wide, reach)
    found = found.select(kept)
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
    reach = max(1, round(REACH * low / of.cell))
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
            votes = _votes(edges, of, some, np.outer(signs, steps), margin, (tall, wide))
            peaks = find_peaks(votes, needed / of.every, reach)
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
    shape: tuple[int, int],
) -> np.ndarray:
    """Return the votes of edges in cells, planes of a shape with a margin about the image.

    Radii of shape (k, n) are signed, to vote for k polarities, with ellipses in some directions.
    """
    some = edges.select(slice(None, None, of.every))
    at = ((it + np.float32(0.5)) / np.float32(of.cell) + margin for it in (some.x, some.y))
    towards = some.unit_x, some.unit_y, radii / -of.cell, np.cos(directions), np.sin(directions)
    tall, wide = shape
    votes = kernels.count_votes(*at, *towards, of.aspect**2, _FLAT_PART, tall=tall, wide=wide)
    return np.asarray(votes.reshape(-1, tall, wide))


def votes_along(
    at: tuple[np.ndarray, np.ndarray],
    unit: tuple[np.ndarray, np.ndarray],
    steps: np.ndarray,
    shape: tuple[int, int],
) -> np.ndarray:
    """Return the votes of points, (k,) each, for the cells at n steps along their directions.

    Those beyond a plane of a shape are left out; the result is that plane alone.
    """
    tall, wide = shape
    towards = *unit, steps[None], np.ones(1), np.zeros(1)
    return np.asarray(kernels.count_votes(*at, *towards, 1.0, 1.0, tall=tall, wide=wide)[0])


@dataclass(frozen=True, slots=True)
class Peaks(ArrayRecord):
    """k places with more votes than their neighbourhood."""

    x: np.ndarray  # (k,), in cells; the middle of the first one of a plane is at 0
    y: np.ndarray
    plane: np.ndarray  # int, (k,)
    votes: np.ndarray  # (k,), in units of those needed


_NONE = np.zeros(0)
_NO_PEAKS = Peaks(_NONE, _NONE, _NONE.astype(int), _NONE)


def find_peaks(votes: np.ndarray, needed: float, reach: int) -> Peaks:
    """Return the cells with enough votes in them and beside them, and none with more within reach.

    Votes are uint16, of shape (planes, rows, columns), and 0 within `reach` cells of the border.
    Of those needed, one for a neighbouring cell counts half, and a quarter on the diagonal.
    """
    _, tall, wide = votes.shape
    own = int(_OWN * needed)
    cells, sums, (x, y), kept = kernels.vote_peaks(
        votes.reshape(-1, wide),
        own,
        needed,
        int(_SPREAD * needed),
        _FLAT,
        reach,
        most=int(np.count_nonzero(votes > own)),
    )
    kept = np.flatnonzero(kept)
    row, column = np.divmod(cells[kept], wide)
    plane, row = np.divmod(row, tall)
    return Peaks(column + x[kept], row + y[kept], plane, sums[kept] / needed)
