"""Candidates for the dots of targets, from the gradient of the logarithm of the image.

The direction of an edge says where the centre of a dot may lie: each edge pixel votes, along its
gradient, for the centres at the radii of interest (Kimme, Ballard & Sklansky, Comm. ACM 18, 1975).
An edge that runs straight on for longer than a dot is wide belongs to no dot and does not vote,
which silences projected stripes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.dots import best
from ahf_ros.features.log_edges import LogEdges, mask_of
from ahf_ros.features.pyramid import LARGEST_RADIUS
from ahf_ros.features.votes import Peaks, find_peaks, highest

class _Range(NamedTuple):
    low: float
    high: float
    cell: int
    votes: float


MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii, those with the most votes."""

_RANGES = (_Range(5.8, LARGEST_RADIUS, 2, 1.2),)
_FIRST_RANGES = (_Range(2.0, 3.4, 1, 0.65), _Range(3.4, 5.8, 1, 1.2), *_RANGES)  # of the first level
_SHAPES = ((1.0, 1), (0.5, 6))
_OBLIQUE = 3.0
_OBLIQUE_CELL = 2
_OBLIQUE_VOTES = 1.5
_GATE = 0.75
_SUB = 2
_STEP = 0.8  # of the radii voted for, in cells
_LONG = 1.5  # length of an edge that is straight, in radii of the largest dot


@dataclass(frozen=True, slots=True)
class Candidates:
    """Points where a dot may be, in the pixels of one level of the pyramid.

    Attributes
    ----------
    level : int
        The level; its pixels are 2^level wide.
    points : ndarray of float64, shape (k, 2)
        Centres, px of the level, to about two pixels.
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
        ranges = [
            some
            for some in (_FIRST_RANGES if level == 1 else _RANGES)
            if some.high * 2**level >= min_radius and some.low * 2**level <= max_radius
        ]
        if not ranges:
            continue
        if _too_few(of_level, ranges, explained, polarities):
            continue
        shape = of_level.marked.shape
        if mask is None:
            mask = mask_of(_reduced(explained, level), shape)
        else:
            mask = cv2.resize(mask, shape[::-1], interpolation=cv2.INTER_NEAREST)
        rest = of_level.unmasked(mask)
        for some in ranges:
            curved = rest.curved(_LONG * some.high)
            points = [_vote(curved, some, polarity) for polarity in polarities]
            polarity = np.repeat(polarities, [len(of_one) for of_one in points])
            candidates.append(Candidates(level, np.concatenate(points), (some.low, some.high), polarity))
    return candidates


def _too_few(
    edges: LogEdges,
    ranges: Sequence[_Range],
    explained: Sequence[np.ndarray] | np.ndarray,
    polarities: Sequence[int],
) -> bool:
    """Return whether edges are too few for any dot, even if nothing explains them.

    This is looked at only where it takes less time than to hide what is explained.
    """
    return len(edges.x) < len(explained) and not any(
        len(_vote(edges, some, polarity))
        for some in ranges
        for polarity in polarities
    )


def _reduced(
    outlines: Sequence[np.ndarray] | np.ndarray, level: int
) -> Sequence[np.ndarray] | np.ndarray:
    """Return outlines in the pixels of a level, an array of them as an array."""
    if isinstance(outlines, np.ndarray):
        return frame.reduced(outlines, level)
    return [frame.reduced(outline, level) for outline in outlines]


def _vote(edges: LogEdges, of: _Range, polarity: int) -> np.ndarray:
    """Return the points, shape (k, 2), that enough edges at the radii point away from."""
    found=[]
    for aspect, directions in _SHAPES:
        if aspect < 1 and of.low < _OBLIQUE:
            continue
        cell = of.cell if aspect == 1 else _OBLIQUE_CELL
        votes = of.votes if aspect == 1 else _OBLIQUE_VOTES
        margin = 1 + int(np.ceil(of.high / cell))
        height, width = (side // cell + 1 for side in edges.marked.shape)
        shape = (height + 2 * margin, width + 2 * margin)
        count = max(2, int(np.ceil((of.high - of.low) / (_STEP * cell))))
        steps = polarity * (of.low + (np.arange(count) + 0.5) * (of.high - of.low) / count)
        for direction in np.pi * np.arange(directions) / directions:
            x,y, unit_x, unit_y, length = _moves(edges, aspect, direction)
            needed = votes * of.low * length
            if count * len(unit_x) <= needed:
                continue
            columns, rows = (
                _cells(at, unit, steps, cell, margin)
                for at, unit in ((x, unit_x), (y, unit_y))
            )
            p = find_peaks(columns, rows, shape, needed, max(1, round(of.low / cell / 2)))
            found.append(replace(p, x=(p.x-margin + .5) * cell - 0.5, y=(p.y-margin+.5)*cell-.5))
    if not found:
        return np.zeros((0, 2))
    p = found[0]
    if len(found) > 1:
        p = Peaks.joined(found)
        margin = 2 + int(np.ceil(of.high / cell))
        shape = (height + 2 * margin, width + 2 * margin)
        cells = (np.rint(p.y/cell).astype(int) + margin) * shape[1] + np.rint(p.x/cell).astype(int) + margin
        p = p.select(highest(cells, p.votes, shape, max(1, round(of.low / cell / 2))))
    height, width = edges.marked.shape
    p = p.select((p.y > -1) & (p.y < height) & (p.x > -1) & (p.x < width))
    kept = best(np.arange(len(p.x)), -p.votes, MAXIMUM_CANDIDATES, 'candidates of one size')
    return np.stack([p.x[kept], p.y[kept]], axis=-1)


def _moves(edges, aspect, direction):
    """Return edges, and the vectors from the middle of an ellipse of major axis 1 to them."""
    if aspect == 1:
        return edges.x, edges.y, edges.unit_x, edges.unit_y, 2 * np.pi
    c, s = np.float32(np.cos(direction)), np.float32(np.sin(direction))
    x,y,ux,uy=edges.x[::_SUB],edges.y[::_SUB],edges.unit_x[::_SUB],edges.unit_y[::_SUB]
    along = ux * c + uy * s
    which = np.flatnonzero(np.abs(along) < _GATE)
    along = along[which]
    across = uy[which] * c - ux[which] * s
    scale = 1 / np.sqrt(along * along + np.float32(aspect**2) * across * across)
    along *= scale
    across *= np.float32(aspect**2) * scale
    return x[which], y[which], along * c - across * s, along * s + across * c, 2 * np.pi * _length(aspect)


@lru_cache
def _length(asp):
    t=np.linspace(0,2*np.pi,2000); dx,dy=-np.sin(t),asp*np.cos(t); ds=np.hypot(dx,dy)
    nx,ny=asp*np.cos(t),np.sin(t); n=np.hypot(nx,ny); g=np.abs(nx/n)<_GATE if asp<1 else np.ones(len(t),bool)
    return float((ds*g).mean()/ (_SUB if asp<1 else 1))


def _cells(
    at: np.ndarray, unit: np.ndarray, steps: np.ndarray, cell: int, margin: int
) -> np.ndarray:
    """Return the rows, or columns, of the cells that edges vote for, int32, shape (n,)."""
    start = (at.astype(np.float32) + np.float32(0.5)) / np.float32(cell) + np.float32(margin)
    moves = (steps / cell).astype(np.float32)[:, None] * unit
    return np.subtract(start, moves, out=moves).astype(np.int32).ravel()
