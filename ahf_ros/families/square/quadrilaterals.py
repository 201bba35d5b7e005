"""Quadrilaterals that may be square markers: four straight edges, dark inside.

In the logarithm of an image, the edge between ink and paper is a step of the same height in any
light. Edge pixels side by side whose gradients agree are straight edges. Where light crosses the
side of a marker, several of them lie on one line, and corners are where two lines meet: neither
has to reach the corner.
"""

from __future__ import annotations

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.log_edges import find_marked
from ahf_ros.vision.pyramid import log_image

_CONTRAST = 2.0  # times that of the image: edges down to a step of a thirteenth
_ALIKE = 0.94, 0.985  # cosine between the gradients of a pixel and its edge; where this is bent
_SHORTEST = 3.0  # edge, px
_STRAIGHT = 0.5  # root of the mean square of the distances of its pixels from a line, px
_GAPS = np.array([10.0, 1.3, 60.0])  # to a corner: px, lengths of an edge; to the next edge, px
_OVERLAP = 3.0  # of an edge beyond a corner, where blur makes it round, px
_TURN = 0.3  # sine of the angle of a corner
_SAME_WAY = 0.98  # cosine between edges of one side
_OFFSET, _BENT = 1.5, 0.03  # of edges from the line of a side: px, and shares of their distance
_SEEN = 0.3  # share of a side that has edges
_SMALLEST = 7.0  # side, px
_APART = 0.5  # corners of different quadrilaterals, px
_MOST = 8, 24, 4  # corners, sides and quadrilaterals for an edge, three times what is usual
_OUTWARDS = 0.3  # from where the logarithm is steepest to where light is half of the step, px
_SMALL_IMAGE = 500_000  # pixels
_CELL = 32.0  # of the grid in which edges are looked for, px


def find_quadrilaterals(gray: np.ndarray, *, small: bool = False) -> np.ndarray:
    """Return the corners of dark quadrilaterals in an image of uint8, px, shape (k, 4, 2).

    They are clockwise in the image, and known to about half a pixel. Those of `small` markers are
    looked for in twice the size as well, if the image is not large.
    """
    found = _enclosed(gray)
    if not small or gray.size > _SMALL_IMAGE:
        return found
    larger = cv2.resize(gray, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    return np.concatenate([found, (_enclosed(larger) + 0.5) / 2 - 0.5])


def _enclosed(gray: np.ndarray) -> np.ndarray:
    """Return the corners of what the straight edges of an image enclose, shape (k, 4, 2)."""
    edges = straight_edges(gray)
    wide, tall = (int(side // _CELL) + 1 for side in gray.shape[::-1])
    rules = np.array([_SAME_WAY, _OFFSET, _BENT, _SEEN, _SMALLEST])
    corners, found, *_ = kernels.edge_quadrilaterals(
        edges,
        _CELL,
        _GAPS,
        _OVERLAP,
        _TURN,
        rules,
        _APART,
        tall=tall,
        wide=wide,
        **{of: most * len(edges) for of, most in zip('clq', _MOST, strict=True)},
    )
    quadrilaterals: np.ndarray = corners[: found[0]]
    return quadrilaterals


def straight_edges(gray: np.ndarray) -> np.ndarray:
    """Return the ends of straight edges of an image, px, shape (k, 4), bright on their left."""
    marked, across, down = find_marked(log_image(gray), _CONTRAST)
    of_pixels, count = (marked, across, down), cv2.countNonZero(marked)
    edges, found, *_ = kernels.straight_edges(
        *of_pixels, *_ALIKE, _SHORTEST, _STRAIGHT, m=int(count / _SHORTEST), e=count
    )
    edges = edges[: found[0]]
    along = edges[:, 2:] - edges[:, :2]
    aside = along[:, ::-1] * [1, -1] / np.hypot(*along.T)[:, None]
    return edges + _OUTWARDS * np.tile(aside, 2)
