"""Dots in the shapes of others, found by votes of edges.

Targets of one image that are near each other have much the same shape. An edge pixel of a dot of
known shape lies at one point of its outline, the one with the same normal, and so votes for one
centre only (the generalised Hough transform: Ballard, Pattern Recognition 13, 1981). Edges of
light vote for places all over the image, where hardly another vote comes together.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.candidates import REACH, find_peaks, votes_along
from ahf_ros.vision.dots import NO_DOTS, Dots
from ahf_ros.vision.log_edges import LogEdges

NEIGHBOURS = 5
"""Dots nearest to a place that tell its shape."""

_BLOCKS = 32  # of places with the same shape, along the longer side of an image
_SHARE = 0.2  # of the outline of a dot, in edge pixels that vote for its centre
_CENTRE = 0.5  # of the first pixel, in cells


def dots_in_shapes(edges: LogEdges, known: np.ndarray, polarity: int) -> Dots:
    """Return the dots in the shapes of those nearest to them.

    Parameters
    ----------
    edges : LogEdges
        Of an image, without the edges of known dots.
    known : ndarray of float64, shape (k, 3, 3)
        Frames of dots, px of this image: one at least. A place has the usual shape of the
        `NEIGHBOURS` that are nearest to it, or of all where there are fewer.
    polarity : int
        1 for dark dots on bright ground, -1 for bright ones.

    Returns
    -------
    Dots
        Centres are known to about a pixel.
    """
    if not len(edges.x):
        return NO_DOTS
    height, width = edges.marked.shape
    side = -(-max(height, width) // _BLOCKS)
    columns = -(-width // side)
    rows, across = np.divmod(np.arange(-(-height // side) * columns), columns)
    one = np.ones(len(rows))
    middles = frame.affine_frames((across + 0.5) * side, (rows + 0.5) * side, one, one, 0 * one)
    near = frame.nearest(middles, known, NEIGHBOURS)
    shapes = np.median(frame.shapes(known)[near], axis=1)
    major, minor, angle = frame.axes_of(shapes)
    towards = _outwards(edges, shapes[edges.y // side * columns + edges.x // side])
    # No vote lies farther outside than the largest dot reaches.
    margin = int(np.ceil(major.max())) + 2
    tall, wide = height + 2 * margin, width + 2 * margin
    at = edges.x + (margin + _CENTRE), edges.y + (margin + _CENTRE)
    votes = votes_along(at, towards, np.array([-polarity]), (tall, wide))
    outline = 2 * np.pi * np.sqrt((major**2 + minor**2) / 2)
    needed = _SHARE * outline.min()
    peaks = find_peaks(votes, needed, max(1, round(REACH * minor.min())))
    x, y = peaks.x - margin, peaks.y - margin
    inside = (x > 0) & (y > 0) & (x < width - 1) & (y < height - 1)
    x, y, votes = x[inside], y[inside], needed * peaks.votes[inside]
    block = (y // side * columns + x // side).astype(int)
    share = votes / outline[block]
    frames = frame.affine_frames(x, y, major[block], minor[block], angle[block])
    return Dots(frames, np.full(len(x), polarity), share).select(share >= _SHARE)


def _outwards(edges: LogEdges, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return from the centres of dots to the edges on their outlines, x and y, float32, (m,).

    At the point x of the ellipse x' S^-1 x = 1 whose normal is n, x is S n / sqrt(n' S n).
    """
    xx, xy, yy = (shapes[:, i, j].astype(np.float32) for i, j in ((0, 0), (0, 1), (1, 1)))
    x = xx * edges.unit_x + xy * edges.unit_y
    y = xy * edges.unit_x + yy * edges.unit_y
    length = np.sqrt(np.maximum(x * edges.unit_x + y * edges.unit_y, np.finfo(np.float32).tiny))
    return x / length, y / length
