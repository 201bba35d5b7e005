"""The dots of an image, found with their ellipses under any light.

`whole_dots` takes the outlines that an edge follows all the way round: fast, and enough where the
light is even. `voted_dots` finds the others, whose outlines the edges of light interrupt, in what
is left of the edges when explained objects are hidden: round ones, those seen at up to 75
degrees, and those out of focus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ahf_ros.vision import frame
from ahf_ros.vision.candidates import find_candidates
from ahf_ros.vision.common_search import dots_in_common
from ahf_ros.vision.dots import NO_DOTS, Dots, best, distinct
from ahf_ros.vision.ellipses import MINIMUM_MINOR, fit_ellipses, resized
from ahf_ros.vision.log_edges import LogEdges
from ahf_ros.vision.pyramid import ImagePyramid

MAXIMUM_OUTLINES = 20_000
"""Whole ellipses kept at the most, those that are most exactly ellipses."""

_LEVELS = 2  # whose edges may follow a whole outline; those of the second are less noisy
_MAXIMUM_SPREAD = 0.15  # of the radius, of the points of a whole ellipse
_MINIMUM_AGREEMENT = 0.7  # mean of the signs of their gradients along the outward direction
_MINIMUM_LENGTH = 0.6  # of an outline, in circumferences of the smallest circle, in edge pixels
_MAXIMUM_LENGTH = 1.1  # the same, in circumferences of the largest
_DEGENERATE = 1e-6  # px^4, smallest determinant of a covariance, of a line


def whole_dots(
    pyramid: ImagePyramid,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    *,
    levels: int = _LEVELS,
) -> Dots:
    """Return the dots with a whole outline, without duplicates, to about half a pixel.

    The radii are bounds of the semi-major axis, px of the image. Dark dots have the polarity 1,
    bright ones -1. Outlines are followed on so many levels of the pyramid, the finest first.
    """
    found = [NO_DOTS]
    for level, edges in enumerate(pyramid.edges[:levels], start=1):
        dots = whole_outlines(edges, min_radius / 2**level, max_radius / 2**level)
        dots = resized(pyramid.logs[level], dots.select(np.isin(dots.polarity, polarities)))
        frames = frame.enlarged(dots.frames, level)
        # The finer outline of a dot is the better one.
        found.append(replace(dots, frames=frames, share=dots.share / level))
    return distinct(Dots.joined(found))


def voted_dots(
    pyramid: ImagePyramid,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots that many gradients point away from, whether their outline is whole or not.

    They have no duplicates; those with the largest share come first. Centres are known to about
    two tenths of a pixel of the image, radii to half a pixel and the blur. Dots a little beyond
    the bounds of the radius, px of the image, may be among them. Edges within outlines that are
    explained already, each of shape (m, 2), do not vote.
    """

    def search(
        low: float, high: float, colours: Sequence[int], explained: Sequence[np.ndarray]
    ) -> Dots:
        candidates = find_candidates(pyramid.edges, low, high, colours, explained)
        return distinct(fit_ellipses(pyramid.logs, candidates))

    kind = min_radius, max_radius, polarities
    return dots_in_common(pyramid.common, search, *kind, explained)


def whole_outlines(edges: LogEdges, min_radius: float, max_radius: float) -> Dots:
    """Return the ellipses that connected edges form all by themselves, at any tilt.

    They and the bounds of the semi-major axis are in px of the edges.
    """
    count, labels = cv2.connectedComponents(edges.marked, connectivity=8, ltype=cv2.CV_32S)
    label = labels[edges.y, edges.x]
    size = np.bincount(label, minlength=count)
    usable = size > 2 * np.pi * min_radius * _MINIMUM_LENGTH
    usable &= size < 2 * np.pi * max_radius * _MAXIMUM_LENGTH
    kept = usable[label]
    pixels, size = edges.select(kept), size[usable]
    label = (np.cumsum(usable) - 1)[label[kept]]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(label, values, minlength=len(size)) / size

    x, y = pixels.x.astype(np.float64), pixels.y.astype(np.float64)
    centre_x, centre_y = mean(x), mean(y)
    x, y = x - centre_x[label], y - centre_y[label]
    # The points of an ellipse have half of its squared axes as their covariance.
    xx, xy, yy = 2 * mean(x * x), 2 * mean(x * y), 2 * mean(y * y)
    determinant = np.maximum(xx * yy - xy * xy, _DEGENERATE)[label]
    radius = (yy[label] * x * x - 2 * xy[label] * x * y + xx[label] * y * y) / determinant
    spread = np.sqrt(mean((np.sqrt(np.maximum(radius, 0)) - 1) ** 2))
    outwards = mean(np.sign(pixels.unit_x * x + pixels.unit_y * y))
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    major, minor = np.sqrt(middle + half), np.sqrt(np.maximum(middle - half, 0))
    good = (spread < _MAXIMUM_SPREAD) & (np.abs(outwards) > _MINIMUM_AGREEMENT)
    good &= (major >= min_radius) & (major <= max_radius) & (minor >= MINIMUM_MINOR)
    some = best(np.flatnonzero(good), spread[good], MAXIMUM_OUTLINES, 'whole ellipses')
    frames = frame.affine_frames(
        centre_x, centre_y, major, minor, np.arctan2(xy, (xx - yy) / 2) / 2
    )
    return Dots(frames[some], np.sign(outwards[some]).astype(int), np.ones(len(some)))
