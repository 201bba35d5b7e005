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

from ahf_ros.features.dots import best
from ahf_ros.features.log_edges import LogEdges
from ahf_ros.features.pyramid import LARGEST_RADIUS

MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii, those with the most votes."""

_MINIMUM_VOTES = 1.5  # a px of the circumference
_RANGES = ((5.8, LARGEST_RADIUS, 2),)  # radii and accumulator cell, px
_FIRST_RANGES = ((2.0, 3.4, 1), (3.4, 5.8, 1), *_RANGES)  # of the first level
_STEP = 0.8  # of the radii voted for, in cells
_REGION = 16  # cells
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
    candidates = []
    for level, of_level in enumerate(edges, start=1):
        ranges = [
            (low, high, cell)
            for low, high, cell in (_FIRST_RANGES if level == 1 else _RANGES)
            if high * 2**level >= min_radius and low * 2**level <= max_radius
        ]
        if not ranges:
            continue
        rest = of_level.outside([(outline + 0.5) / 2**level - 0.5 for outline in explained])
        for low, high, cell in ranges:
            curved = rest.curved(_LONG * high)
            points = [_vote(curved, (low, high), cell, polarity) for polarity in polarities]
            polarity = np.repeat(polarities, [len(of_one) for of_one in points])
            candidates.append(Candidates(level, np.concatenate(points), (low, high), polarity))
    return candidates


def _vote(edges: LogEdges, radii: tuple[float, float], cell: int, polarity: int) -> np.ndarray:
    """Return the points, shape (k, 2), that enough edges at the radii point away from."""
    height, width = (side // cell + 1 for side in edges.marked.shape)
    low, high = radii
    count = max(2, int(np.ceil((high - low) / (_STEP * cell))))
    steps = low + (np.arange(count) + 0.5) * (high - low) / count
    distance = polarity * steps[:, None]
    columns = ((edges.x - distance * edges.unit_x + 0.5) / cell).astype(np.int32).ravel()
    rows = ((edges.y - distance * edges.unit_y + 0.5) / cell).astype(np.int32).ravel()
    inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    columns, rows = columns[inside], rows[inside]
    needed = _MINIMUM_VOTES * 2 * np.pi * low
    # Where few edges are left, no region holds as many votes as one point needs.
    regions = (size // _REGION + 1 for size in (width, height))
    if _votes(columns // _REGION, rows // _REGION, *regions).max() <= needed:
        return np.zeros((0, 2))
    votes = _votes(columns, rows, width, height)
    reach = 2 * max(1, round(low / cell / 2)) + 1
    highest = cv2.dilate(votes, np.ones((reach, reach), np.uint8))
    peaks = np.flatnonzero((votes >= highest) & (votes > needed))
    peaks = best(peaks, -votes.ravel()[peaks], MAXIMUM_CANDIDATES, 'candidates of one size')
    rows, columns = np.divmod(peaks, width)
    return (np.stack([columns, rows], axis=-1) + 0.5) * cell - 0.5


def _votes(columns: np.ndarray, rows: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the votes in the nine cells about each cell, ndarray of float32."""
    cast = np.bincount(rows * width + columns, minlength=height * width)
    return cv2.blur(cast.reshape(height, width).astype(np.float32), (3, 3)) * 9
