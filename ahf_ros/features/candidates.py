"""Candidates for the dots of targets, from the gradient of the logarithm of the image.

The direction of an edge says where the centre of a dot may lie: each edge pixel votes, along its
gradient, for the centres at the radii of interest (Kimme, Ballard & Sklansky, Comm. ACM 18, 1975).
An edge that runs straight on for longer than a dot is wide belongs to no dot and does not vote,
which silences projected stripes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.dots import best
from ahf_ros.features.log_edges import LogEdges, mask_of
from ahf_ros.features.pyramid import LARGEST_RADIUS

MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii, those with the most votes."""

_MINIMUM_VOTES = 1.5  # a px of the circumference
_RANGES = ((5.8, LARGEST_RADIUS, 2),)  # radii and accumulator cell, px
_FIRST_RANGES = ((2.0, 3.4, 1), (3.4, 5.8, 1), *_RANGES)  # of the first level
_STEP = 0.8  # of the radii voted for, in cells
_SHIFT = 2
_BLOCK = 1 << _SHIFT  # cells, side of the blocks in which votes are counted first
_MAXIMUM_VOTES = 7000  # that are counted in a cell, so that nine of them fit into 16 bits
_OUTSIDE = cv2.BORDER_CONSTANT  # no votes are there
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
            (low, high, cell)
            for low, high, cell in (_FIRST_RANGES if level == 1 else _RANGES)
            if high * 2**level >= min_radius and low * 2**level <= max_radius
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
        for low, high, cell in ranges:
            curved = rest.curved(_LONG * high)
            points = [_vote(curved, (low, high), cell, polarity) for polarity in polarities]
            polarity = np.repeat(polarities, [len(of_one) for of_one in points])
            candidates.append(Candidates(level, np.concatenate(points), (low, high), polarity))
    return candidates


def _too_few(
    edges: LogEdges,
    ranges: Sequence[tuple[float, float, int]],
    explained: Sequence[np.ndarray] | np.ndarray,
    polarities: Sequence[int],
) -> bool:
    """Return whether edges are too few for any dot, even if nothing explains them.

    This is looked at only where it takes less time than to hide what is explained.
    """
    return len(edges.x) < len(explained) and not any(
        len(_vote(edges, (low, high), cell, polarity))
        for low, high, cell in ranges
        for polarity in polarities
    )


def _reduced(
    outlines: Sequence[np.ndarray] | np.ndarray, level: int
) -> Sequence[np.ndarray] | np.ndarray:
    """Return outlines in the pixels of a level, an array of them as an array."""
    if isinstance(outlines, np.ndarray):
        return frame.reduced(outlines, level)
    return [frame.reduced(outline, level) for outline in outlines]


def _vote(edges: LogEdges, radii: tuple[float, float], cell: int, polarity: int) -> np.ndarray:
    """Return the points, shape (k, 2), that enough edges at the radii point away from."""
    low, high = radii
    needed = _MINIMUM_VOTES * 2 * np.pi * low
    height, width = (side // cell + 1 for side in edges.marked.shape)
    count = max(2, int(np.ceil((high - low) / (_STEP * cell))))
    if count * len(edges.x) <= needed:
        return np.zeros((0, 2))
    steps = polarity * (low + (np.arange(count) + 0.5) * (high - low) / count)
    margin = _BLOCK * int(np.ceil(high / cell / _BLOCK))  # votes may lie outside of the image
    columns, rows = (
        _cells(at, unit, steps, cell, margin)
        for at, unit in ((edges.x, edges.unit_x), (edges.y, edges.unit_y))
    )
    votes = _votes(columns, rows, (height + 2 * margin, width + 2 * margin), needed)
    if votes is None:
        return np.zeros((0, 2))
    rows, columns = _peaks(votes, needed, max(1, round(low / cell / 2)))
    rows, columns = rows - margin, columns - margin
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = rows[inside], columns[inside]
    ranks = -votes[rows + margin, columns + margin].astype(int)
    kept = best(np.arange(len(ranks)), ranks, MAXIMUM_CANDIDATES, 'candidates of one size')
    return (np.stack([columns[kept], rows[kept]], axis=-1) + 0.5) * cell - 0.5


def _peaks(votes: np.ndarray, needed: float, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the cells with enough votes, and none with more within reach."""
    wide = votes.shape[1]
    high = np.flatnonzero(votes > int(needed))
    values = votes.ravel()
    own = values[high]
    peak = np.ones(len(high), bool)
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            peak &= own >= values.take(high + (down * wide + across), mode='clip')
    rows, columns = np.divmod(high[peak], wide)
    return rows, columns


def _cells(
    at: np.ndarray, unit: np.ndarray, steps: np.ndarray, cell: int, margin: int
) -> np.ndarray:
    """Return the rows, or columns, of the cells that edges vote for, int32, shape (n,)."""
    start = (at.astype(np.float32) + np.float32(0.5)) / np.float32(cell) + np.float32(margin)
    moves = (steps / cell).astype(np.float32)[:, None] * unit
    return np.subtract(start, moves, out=moves).astype(np.int32).ravel()


def _votes(
    columns: np.ndarray, rows: np.ndarray, shape: tuple[int, int], needed: float
) -> np.ndarray | None:
    """Return the votes in the nine cells about each cell, uint16, if any has those needed.

    Votes are counted only in blocks of cells that, with their neighbours, have so many.
    """
    tall, wide = (-(-side // _BLOCK) for side in shape)
    block = (rows >> _SHIFT) * np.int32(wide) + (columns >> _SHIFT)
    cast = np.bincount(block, minlength=tall * wide).reshape(tall, wide)
    of_blocks = np.minimum(cast, _MAXIMUM_VOTES).astype(np.uint16)
    around = cv2.boxFilter(of_blocks, cv2.CV_32F, (3, 3), normalize=False, borderType=_OUTSIDE)
    enough = (around > needed).astype(np.uint8)
    hot = (cv2.dilate(enough, np.ones((3, 3), np.uint8)) > 0) & (of_blocks > 0)
    count = np.count_nonzero(hot)
    if not count:
        return None
    slots = np.zeros(hot.shape, np.int32)
    slots[hot] = np.arange(1, count + 1)
    last = np.int32(_BLOCK - 1)
    places = slots.ravel()[block] << 2 * _SHIFT
    places += (rows & last) << _SHIFT
    places += columns & last
    of_cells = np.bincount(places, minlength=(count + 1) << 2 * _SHIFT)[_BLOCK**2 :]
    votes = np.zeros((tall, _BLOCK, wide, _BLOCK), np.uint16)
    down, across = np.nonzero(hot)
    of_hot = np.minimum(of_cells, _MAXIMUM_VOTES).reshape(count, _BLOCK, _BLOCK)
    votes[down, :, across] = of_hot
    whole = votes.reshape(tall * _BLOCK, wide * _BLOCK)
    return cv2.boxFilter(whole, cv2.CV_16U, (3, 3), normalize=False, borderType=_OUTSIDE)
