"""Whether points are inked, from the outlines that printers get."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ahf_ros.prints.designs import Arc, Contour, Point


def inked(contours: Sequence[Contour], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return whether points are inside an odd number of contours, bool, in the shape of `x`.

    A line from a point to the right crosses the contour that the point is inside of an odd number
    of times.
    """
    inside = np.zeros(x.shape, bool)
    for contour in contours:
        _cross(inside, contour, x, y)
    return inside


def _cross(inside: np.ndarray, contour: Contour, x: np.ndarray, y: np.ndarray) -> None:
    """Turn `inside` over, in place, for each crossing of a contour to the right of a point."""
    first = contour[0]
    if len(contour) == 1 and isinstance(first, Arc):  # a circle
        inside ^= (x - first.x) ** 2 + (y - first.y) ** 2 < first.radius**2
        return
    ends = [_ends(item) for item in contour]
    for item, (start, end), (following, _) in zip(contour, ends, ends[1:] + ends[:1], strict=True):
        if isinstance(item, Arc):
            _cross_arc(inside, item, start, end, x, y)
        _cross_line(inside, end, following, x, y)


def _ends(item: Point | Arc) -> tuple[Point, Point]:
    """Return where a corner or an arc begins and ends."""
    if not isinstance(item, Arc):
        return item, item
    return _on_arc(item, item.start), _on_arc(item, item.start + item.extent)


def _on_arc(arc: Arc, angle: float) -> Point:
    return arc.x + arc.radius * math.cos(angle), arc.y + arc.radius * math.sin(angle)


def _cross_line(
    inside: np.ndarray, start: Point, end: Point, x: np.ndarray, y: np.ndarray
) -> None:
    if start[1] == end[1]:
        return
    level = (start[1] <= y) != (end[1] <= y)
    slope = (end[0] - start[0]) / (end[1] - start[1])
    inside[level] ^= x[level] < start[0] + (y[level] - start[1]) * slope


def _cross_arc(
    inside: np.ndarray, arc: Arc, start: Point, end: Point, x: np.ndarray, y: np.ndarray
) -> None:
    """Cross an arc in parts that are to the left or to the right of its centre only."""
    low, high = sorted((arc.start, arc.start + arc.extent))
    quarter = math.pi / 2
    turns = range(math.ceil(low / math.pi - 0.5), math.floor(high / math.pi - 0.5) + 1)
    between = [quarter + math.pi * turn for turn in turns if low < quarter + math.pi * turn < high]
    heights = [arc.y + arc.radius * round(math.sin(angle)) for angle in between]
    bottom, top = (start[1], end[1]) if arc.extent > 0 else (end[1], start[1])
    angles, levels = [low, *between, high], [bottom, *heights, top]
    for number, (here, there) in enumerate(pairwise(levels)):
        if here == there:
            continue
        level = (here <= y) != (there <= y)
        side = math.copysign(1.0, math.cos((angles[number] + angles[number + 1]) / 2))
        reach = np.sqrt(np.maximum(arc.radius**2 - (y[level] - arc.y) ** 2, 0))
        inside[level] ^= x[level] < arc.x + side * reach
