"""Candidates for the dots of targets, from the gradient of the logarithm of the image.

The direction of an edge says where the centre of a dot may lie: each edge pixel votes, along its
gradient, for the centres at the radii of interest (Kimme, Ballard & Sklansky, Comm. ACM 18, 1975).
On an ellipse the centre does not lie along the gradient, but in a direction that follows from it
and from the shape; so oblique dots are voted for with ellipses in several directions. An edge that
runs straight on for longer than a dot is wide belongs to no dot and does not vote, which silences
projected stripes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.dots import best
from ahf_ros.features.log_edges import LogEdges, mask_of
from ahf_ros.features.pyramid import MAXIMUM_RADIUS
from ahf_ros.features.votes import NO_PEAKS, Peaks, find_peaks, highest

MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii and one polarity, those with most votes."""


class _Shape(NamedTuple):
    """Ellipses that are voted for.

    Attributes
    ----------
    aspect : float
        Ratio of their axes.
    directions : int
        Number of directions of the major axis.
    cell : int
        Side of the cells in which votes are counted, px.
    votes : float
        Needed, for a px of the circumference of the smallest dot, as if it were round.
    every : int
        One of so many edges votes.
    """

    aspect: float
    directions: int
    cell: int
    votes: float
    every: int


_TINY = _Shape(1.0, 1, 1, 0.6, 1)  # whose edges are the least exact
_SMALL = _Shape(1.0, 1, 1, 1.4, 1)
_LARGE = _Shape(1.0, 1, 2, 1.4, 1)
_OBLIQUE = _Shape(0.5, 6, 2, 1.2, 2)  # finds shapes of 0.3 to 0.7, up to 70 degrees
_RANGES = {  # by semi-major axes, px
    (3.4, 5.8): (_SMALL,),  # out of focus, as others are found on the level below
    (5.8, MAXIMUM_RADIUS): (_LARGE, _OBLIQUE),
}
_FIRST_RANGES = {  # of the first level
    (2.0, 3.4): (_TINY,),
    (3.4, 5.8): (_SMALL, _OBLIQUE),
    (5.8, MAXIMUM_RADIUS): (_LARGE, _OBLIQUE),
}
_STEP = 0.8  # of the radii voted for, in cells
_FLAT = 0.75  # sine of the angle between an edge of an ellipse and its major axis, at the most
_REACH = 0.5  # within which no other centre has more votes, in radii of the smallest dot
_CELL = 2  # in which the votes for different shapes are compared, px
_LONG = 1.5  # length of an edge that is straight, in radii of the largest dot


@dataclass(frozen=True, slots=True)
class Candidates:
    """Points where a dot may be, in the pixels of one level of the pyramid.

    Attributes
    ----------
    level : int
        The level; its pixels are 2^level wide.
    points : ndarray of float64, shape (k, 2)
        Centres, px of the level, to about a pixel.
    radii : tuple of 2 float
        Smallest and largest radius of the dots, px of the level.
    polarity : ndarray of int, shape (k,)
        1 for a dark dot on bright ground, -1 for a bright one on dark.
    """

    level: int
    points: np.ndarray
    radii: tuple[float, float]
    polarity: np.ndarray


def find_candidates(
    edges: Sequence[LogEdges],
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> list[Candidates]:
    """Find the points where dots may be.

    Parameters
    ----------
    edges : sequence of LogEdges
        Of the levels of the pyramid from the first half on.
    min_radius, max_radius : float
        Of the dots, px of the image.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.
    explained : sequence of ndarray of float, each of shape (m, 2)
        Outlines of objects that are known already, px of the image. Edges inside do not vote.

    Returns
    -------
    list of Candidates
        One for each range of radii.
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
    found = Peaks.joined([_peaks(edges, radii, of, polarities) for of in shapes])
    points = np.stack([found.x, found.y], axis=-1)
    inside = np.all((points > -1) & (points < edges.marked.shape[::-1]), axis=1)
    found, points = found.select(inside), points[inside]
    reach = max(1, round(_REACH * radii[0] / _CELL))
    margin = reach + 1
    tall, wide = (side // _CELL + 1 + 2 * margin for side in edges.marked.shape)
    columns, rows = np.rint((points.T + 0.5) / _CELL - 0.5).astype(int) + margin
    cells = (found.plane * tall + rows) * wide + columns
    kept = highest(cells, found.votes, (len(polarities) * tall, wide), reach)
    found, points = found.select(kept), points[kept]
    # Spots of light may be many, of one polarity, and must not crowd out the other.
    chosen = [
        best(which, -found.votes[which], MAXIMUM_CANDIDATES, 'candidates of one size')
        for which in (np.flatnonzero(found.plane == number) for number in range(len(polarities)))
    ]
    kept = np.concatenate([np.zeros(0, np.intp), *chosen])
    return points[kept], np.asarray(polarities, int)[found.plane[kept]]


def _peaks(
    edges: LogEdges, radii: tuple[float, float], of: _Shape, polarities: Sequence[int]
) -> Peaks:
    """Return the points that enough edges of a shape vote for, px, with indices of polarities."""
    low, high = radii
    count = max(2, ceil((high - low) / (_STEP * of.cell)))
    steps = low + (np.arange(count) + 0.5) * (high - low) / count
    needed = of.votes * 2 * np.pi * low
    if not len(polarities) or count * len(edges.x) <= needed:
        return NO_PEAKS
    reach = max(1, round(_REACH * low / of.cell))
    margin = reach + ceil(high / of.cell) + 1  # votes may lie outside of the image
    tall, wide = (side // of.cell + 1 + 2 * margin for side in edges.marked.shape)
    # Votes for each polarity and direction are counted in a plane of their own.
    columns, rows = _votes(edges, of, np.outer(polarities, steps), margin, tall)
    planes = len(polarities) * of.directions
    peaks = find_peaks(columns, rows, (planes, tall, wide), needed / of.every, reach)
    x, y = ((at - margin + 0.5) * of.cell - 0.5 for at in (peaks.x, peaks.y))
    return replace(peaks, x=x, y=y, plane=peaks.plane // of.directions)


def _votes(
    edges: LogEdges, of: _Shape, radii: np.ndarray, margin: int, tall: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns and rows of the cells that edges vote for, int32, shape (n,).

    Parameters
    ----------
    edges : LogEdges
    of : _Shape
    radii : ndarray of float, shape (k, n)
        Signed, to vote for k polarities.
    margin : int
        Cells about the image.
    tall : int
        Rows of a plane.
    """
    columns, rows = [], []
    cell = np.float32(of.cell)
    some = edges.select(slice(None, None, of.every))
    x, y = ((at + np.float32(0.5)) / cell + np.float32(margin) for at in (some.x, some.y))
    steps = (radii / of.cell).astype(np.float32)[..., None]
    for number, angle in enumerate(np.pi * np.arange(of.directions) / of.directions):
        start_x, start_y, unit_x, unit_y = x, y, some.unit_x, some.unit_y
        if of.aspect < 1:
            which, unit_x, unit_y = _towards_centres(some, of.aspect, angle)
            start_x, start_y = x[which], y[which]
        for polarity, moves in enumerate(steps):
            top = np.int32((polarity * of.directions + number) * tall)
            columns.append((start_x - moves * unit_x).astype(np.int32).ravel())
            rows.append((start_y - moves * unit_y).astype(np.int32).ravel() + top)
    return np.concatenate(columns), np.concatenate(rows)


def _towards_centres(
    edges: LogEdges, aspect: float, angle: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return edges that may be flat ones of an ellipse, and where they lie on it.

    Returns
    -------
    which : ndarray of int, shape (k,)
    x, y : ndarray of float32, shape (k,)
        From the centre of the ellipse whose semi-major axis is 1.
    """
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    along = edges.unit_x * cosine + edges.unit_y * sine
    which = np.flatnonzero(np.abs(along) < np.float32(_FLAT))
    along = along[which]
    across = edges.unit_y[which] * cosine - edges.unit_x[which] * sine
    # The point of the ellipse (u / 1)^2 + (v / aspect)^2 = 1 with this normal.
    square = np.float32(aspect**2)
    scale = 1 / np.sqrt(along * along + square * across * across)
    along, across = along * scale, across * (square * scale)
    return which, along * cosine - across * sine, along * sine + across * cosine
