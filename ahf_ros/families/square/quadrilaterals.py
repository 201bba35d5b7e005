"""Quadrilaterals that may be square markers: dark regions with four straight sides.

A pixel is dark where it is less than the mean of the darkest and the brightest one about it. In
gray values this separates ink and paper in even light, in their logarithms it does so in any light
that changes less than ink and paper do.
Where a cover or another dark thing changes the outline, its four longest sides are left.
"""

from __future__ import annotations

from itertools import chain
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.families.square.frames import meet
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.outlines import ends_of, measured, points_of
from ahf_ros.vision.sampling import sample

_WINDOW = 13  # in which a pixel is compared, px
_MINIMUM_STEP = 24  # from the darkest to the brightest pixel of a window, of 255
_SMALLEST = 8.0  # side of a quadrilateral, px
_SHORTEST = 2.8  # outline, in such sides
_SOLID = 0.3  # minimum area of a region with its holes, as a share of a square's of its perimeter
_TATTERED, _FILLED = 4.0, 0.15  # bounds of outline and area of a region whose hull is taken
_TOLERANCE = 0.025  # of the corners of an outline, as a share of its length
_MAXIMUM_CORNERS = 14  # of the polygon of an outline
_FOUR = 0.55  # minimum share of its four longest sides in the perimeter of a polygon
_SAME_LINE = 0.15, 0.03  # sides of one line: sine of their angle, distance in perimeters
_NEAR = 0.02, 1.2  # of points that belong to a side, as a share of the perimeter, and px
_ENDS = 0.1  # of a side, left out at its ends, where blur rounds the corner
_FEWEST = 3  # points of a side
_LEAST = 1e-9  # sum of squares of places along a side, that a slope is divided by
_COMMON_AREA = 0.6, 1.9  # of a quadrilateral, as a share of its region's
_DEPTH, _SIDE = 0.12, 0.2  # of samples beside a side, to the middle; share of them with a step
_ALONG = np.linspace(0.06, 0.94, 10)  # a side, where they are
_LEVELS = np.arange(256)
_SCALES = tuple(
    (np.rint(255 * of / of[-1]).astype(np.uint8), growth)
    for of, growth in ((_LEVELS, 0.5), (np.log(_LEVELS / LOG_OFFSET + 1), 0.9))
)
"""Tables of values by gray value, and distances of the outermost dark pixels from the edge, px."""


class _Regions(NamedTuple):
    polygons: list[np.ndarray]  # (m, 1, 2) each, px, clockwise in the image
    outlines: list[np.ndarray]  # (n, 1, 2) each, their outermost pixels
    lengths: np.ndarray  # (k,), of the outlines, or of those of their hulls, px
    areas: np.ndarray  # (k,), with their holes, px^2
    growths: np.ndarray  # (k,), distances of the outermost pixels from the edge, px


def find_quadrilaterals(gray: np.ndarray) -> np.ndarray:
    """Return the corners of dark quadrilaterals in an image of uint8, px, shape (k, 4, 2).

    They are clockwise in the image, and known to about half a pixel.
    """
    window = np.ones((_WINDOW, _WINDOW), np.uint8)
    traced = []
    for table, growth in _SCALES:
        values = cv2.LUT(gray, table)
        low, high = cv2.erode(values, window), cv2.dilate(values, window)
        middle = cv2.addWeighted(low, 0.5, high, 0.5, 0)
        step = cv2.subtract(high, low, high)  # in place, as the next: large images need no copies
        cv2.threshold(step, _MINIMUM_STEP, 255, cv2.THRESH_BINARY, step)
        dark = cv2.compare(values, middle, cv2.CMP_LT, low)
        cv2.bitwise_and(dark, step, dark)
        del low, high, middle, step
        traced.append((_outlines(dark), growth))
    # Squares that touch at their corners, such as those of an AprilGrid, hang together by a few
    # pixels. Without their outermost pixels they do not.
    traced.append((_outlines(cv2.erode(dark, np.ones((3, 3), np.uint8))), growth + 1))
    del dark
    growths = np.repeat([growth for _, growth in traced], [len(of) for of, _ in traced])
    regions = _regions([*chain(*(of for of, _ in traced))], growths)
    del traced
    sides, four = _four_sides(regions)
    bordered = _bordered(values, sides, regions.areas[four])
    lines = _fitted(regions, four[bordered], sides[bordered])
    before = np.roll(lines, 1, axis=1)
    corners = meet(before[:, :, 0], before[:, :, 1], lines[:, :, 0], lines[:, :, 1])
    apart = corners.astype(np.float32)  # in which corners that are nearly one are one
    along = np.roll(apart, -1, axis=1) - apart
    turns = np.sign(_cross(along, np.roll(along, -1, axis=1)))
    return corners[np.abs(turns.sum(axis=1)) == 4]


def _outlines(dark: np.ndarray) -> list[np.ndarray]:
    """Return the outlines of regions and of holes that are large enough, (n, 1, 2) each."""
    outlines, _ = cv2.findContours(dark, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    return [of for of in outlines if of.shape[0] >= _SHORTEST * _SMALLEST]


def _regions(outlines: list[np.ndarray], growths: np.ndarray) -> _Regions:
    """Return the regions in outlines that may have four straight sides."""
    areas, lengths, boxes = measured(outlines)
    areas = -areas  # of holes negative
    solid = areas >= _SOLID * lengths**2 / 16
    likely = lengths <= _TATTERED * boxes.sum(axis=1)
    likely &= areas >= _FILLED * boxes.prod(axis=1)
    which = np.flatnonzero((areas >= 0) & (solid | likely))
    around = [
        outlines[index] if solid[index] else cv2.convexHull(outlines[index])
        for index in which.tolist()
    ]
    areas, lengths, _ = measured(around)
    areas = np.abs(areas)
    large = areas >= np.maximum(_SOLID * lengths**2 / 16, _SMALLEST**2 / 2)
    tolerances = np.maximum(_TOLERANCE * lengths, 1.0)
    polygons = [
        cv2.approxPolyDP(around[index], tolerances[index], closed=True)
        for index in np.flatnonzero(large).tolist()
    ]
    turned = measured(polygons)[0] <= 0
    counts = np.array([*map(len, polygons)])
    some = np.flatnonzero((counts >= 4) & (counts <= _MAXIMUM_CORNERS))
    kept = np.flatnonzero(large)[some]
    which = which[kept]
    return _Regions(
        [polygons[index][::-1] if turned[index] else polygons[index] for index in some],
        [outlines[index] for index in which],
        lengths[kept],
        areas[kept],
        growths[which],
    )


def _bordered(values: np.ndarray, sides: np.ndarray, regions: np.ndarray) -> np.ndarray:
    """Return the indices of sides that meet about their regions, dark inside, bright outside.

    The sides have the shape (k, 4, 2, 2), the areas of their regions (k,).
    """
    before = np.roll(sides, 1, axis=1)
    corners = meet(before[:, :, 0], before[:, :, 1], sides[:, :, 0], sides[:, :, 1])
    after = np.roll(corners, -1, axis=1)
    x, y = np.moveaxis(corners, 2, 0)
    areas = (x * after[..., 1] - y * after[..., 0]).sum(axis=1) / 2
    ratio = areas / regions
    which = np.flatnonzero((ratio > _COMMON_AREA[0]) & (ratio < _COMMON_AREA[1]))
    corners, after = corners[which, :, None], after[which, :, None]
    points = corners + _ALONG[:, None] * (after - corners)
    aside = _DEPTH * (corners.mean(axis=1, keepdims=True) - points)
    shape = len(which), 4 * len(_ALONG), 2
    if not len(which):
        return which
    ink, paper = (
        sample(values, (points + of).reshape(shape)).reshape(points.shape[:3]).astype(np.float64)
        for of in (aside, -aside)
    )
    seen = (paper - ink > _MINIMUM_STEP / 4).mean(axis=2).min(axis=1) >= _SIDE
    return which[seen]


def _four_sides(regions: _Regions) -> tuple[np.ndarray, np.ndarray]:
    """Return the four longest sides of polygons, (k, 4, 2, 2), and the indices of their regions.

    They are in the order of the polygon, and no two are on one line; polygons without four such
    sides have none.
    """
    counts = np.array([*map(len, regions.polygons)], int)
    used = np.arange(_MAXIMUM_CORNERS) < counts[:, None]
    starts = np.zeros((*used.shape, 2))
    starts[used] = points_of(regions.polygons)
    ends = np.roll(starts, -1, axis=1)
    ends[np.arange(len(counts)), counts - 1] = starts[:, 0]
    vectors = np.where(used[..., None], ends - starts, 0)
    lengths = np.hypot(vectors[..., 0], vectors[..., 1])
    longest = np.sort(lengths, axis=1)[:, -4:].sum(axis=1)
    which = np.flatnonzero(longest >= _FOUR * lengths.sum(axis=1))
    starts, ends, vectors, lengths = (of[which] for of in (starts, ends, vectors, lengths))
    aside = _SAME_LINE[1] * regions.lengths[which, None]
    chosen = used[which] & (counts[which] == 4)[:, None]
    order = np.argsort(-lengths, axis=1, kind='stable')
    rows = np.arange(len(which))
    for rank in range(_MAXIMUM_CORNERS):
        rows = rows[(counts[which[rows]] > rank) & (chosen[rows].sum(axis=1) < 4)]
        if not len(rows):
            break
        index = order[rows, rank]
        vector, others = vectors[rows, index, None], vectors[rows]
        offset = starts[rows, index, None] + vector / 2 - starts[rows]
        turned = (
            np.abs(_cross(others, vector))
            < _SAME_LINE[0] * lengths[rows] * lengths[rows, index, None]
        )
        same = (
            turned & (np.abs(_cross(others, offset)) < aside[rows] * lengths[rows]) & chosen[rows]
        )
        chosen[rows, index] = ~same.any(axis=1)
    four = chosen.sum(axis=1) == 4
    sides = np.stack([starts, ends], axis=2)[four][chosen[four]]
    return sides.reshape(-1, 4, 2, 2), which[four]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross products of vectors, shape (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _fitted(regions: _Regions, which: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Return the ends of lines fitted to the points near four sides of regions, (k, 4, 2, 2).

    Regions are left out that have a side with few points.
    """
    outlines = [regions.outlines[index] for index in which]
    near = np.maximum(_NEAR[0] * regions.lengths[which], _NEAR[1])
    of_sides = sides, near, regions.growths[which], 0.5 - _ENDS, _LEAST
    lines, fewest = kernels.side_lines(points_of(outlines), ends_of(outlines), *of_sides)
    fitted: np.ndarray = lines[fewest >= _FEWEST]
    return fitted
