"""Outlines of printed targets: closed contours of the shapes of their ink, for printers."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ahf_ros.prints.prints import Cells, Disc, Ring, Sectors, Shape

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc of a circle, counter-clockwise where `extent` is positive; angles in rad."""

    x: float
    y: float
    radius: float
    start: float
    extent: float


Contour = tuple[Point | Arc, ...]
"""A closed outline: corners and arcs in their order, joined by straight lines."""


def contours(ink: Iterable[Shape]) -> tuple[Contour, ...]:
    """Return the outlines of shapes: a point inside an odd number of contours is inked.

    Examples
    --------
    >>> from ahf_ros.prints.ring import family
    >>> rings = family('metashape12')
    >>> len(contours(rings.ink(rings.word(1), pinhole=0.05)))  # dot, hole, two arcs of the band
    4
    """
    return tuple(contour for shape in ink for contour in _contours(shape))


def _contours(shape: Shape) -> Iterator[Contour]:
    if isinstance(shape, Disc):
        yield circle(shape.radius, shape.x, shape.y)
        if shape.hole:
            yield circle(shape.hole, shape.x, shape.y)
    elif isinstance(shape, Ring):
        yield from (circle(shape.inner), circle(shape.outer))
    elif isinstance(shape, Sectors):
        yield from _arcs(shape)
    else:
        yield from _sides(shape)


def circle(radius: float, x: float = 0.0, y: float = 0.0) -> Contour:
    """Return the outline of a circle."""
    return (Arc(x=x, y=y, radius=radius, start=0.0, extent=2 * math.pi),)


def _arcs(band: Sectors) -> Iterator[Contour]:
    """Yield the outlines of the arcs of a band; sectors side by side are one arc."""
    inked = np.array(band.inked)
    sector = 2 * math.pi / len(inked)
    for first in np.flatnonzero(inked & ~np.roll(inked, 1)).tolist():
        count = int(np.argmin(np.roll(inked, -first)))
        start, extent = first * sector, count * sector
        outer = Arc(x=0.0, y=0.0, radius=band.outer, start=start, extent=extent)
        yield outer, Arc(x=0.0, y=0.0, radius=band.inner, start=start + extent, extent=-extent)


def _sides(cells: Cells) -> Iterator[Contour]:
    """Yield the polygons about the inked cells."""
    side = len(cells.inked)
    scale = 2 * cells.half_side / side
    for corners in _outlines(np.array(cells.inked)):
        yield tuple(((x - side / 2) * scale, (side / 2 - y) * scale) for x, y in corners)


def _outlines(cells: np.ndarray) -> list[list[tuple[int, int]]]:
    """Return the corners (column, row) of the polygons that bound the true cells of a picture."""
    padded = np.pad(cells, 1)
    after: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.argwhere(cells).tolist():
        corners = [(column, row), (column, row + 1), (column + 1, row + 1), (column + 1, row)]
        for index, (down, right) in enumerate([(1, 0), (2, 1), (1, 2), (0, 1)]):
            if not padded[row + down, column + right]:
                after.setdefault(corners[index], []).append(corners[(index + 1) % 4])
    polygons = []
    while after:
        start = corner = next(iter(after))
        polygon = []
        while True:
            polygon.append(corner)
            following = after[corner].pop()
            if not after[corner]:
                del after[corner]
            corner = following
            if corner == start:
                break
        polygons.append(_without_straight(polygon))
    return polygons


def _without_straight(polygon: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return a polygon with sides along the axes without the corners at which it goes straight."""
    around = zip([polygon[-1], *polygon], polygon, [*polygon[1:], polygon[0]], strict=False)
    return [at for before, at, next_ in around if before[0] != next_[0] and before[1] != next_[1]]
