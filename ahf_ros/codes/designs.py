"""Printed designs of the families: the outlines of the ink, and the free area about it.

Lengths are in radii of the dot, with x to the right and y upwards as printed. The origin is the
centre of the target. The corner or edge where the reading of a word begins lies on the x axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ahf_ros.codes.cctag import CircleFamily
from ahf_ros.codes.dots import DotFamily
from ahf_ros.codes.families import FAMILY_NAMES, code_family
from ahf_ros.codes.gsi import PointFamily
from ahf_ros.codes.ring import Family, sectors
from ahf_ros.codes.square import SQUARE_NAMES, marker

HALF_SIDE = 2.4
"""Half the side of a square marker, in radii of the dot of a ring target of the same size."""

_WIDER = 1.2  # times the reach of a ring target
_QUIET_ZONE = 4.2  # of ring targets and square markers at least: that of a band up to 3.5
_MARGIN = 1.0  # about the outermost dot or border of the other families, in radii of the dot
_CCTAG_ZONE = 1.5  # of CCTags, in radii of the outermost circle, which is their dot

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


@dataclass(frozen=True, slots=True)
class Proportions:
    """What the targets of a family have in common; lengths are in radii of the dot.

    `reach` is the radius of the circle that holds all ink, `radius` that of the circle whose image
    is reported as the ellipse of the target, and `quiet_zone` that of the area that is left free.
    `radii` has the lengths of the design by their names. `pinhole` is the radius of the hole in
    the dot, 0 for none, and `polarity` the colour of the ink, 'dark' or 'bright'.
    """

    reach: float
    radius: float
    quiet_zone: float
    radii: dict[str, float]
    pinhole: float = 0.0
    polarity: str = 'dark'

    def chosen(self, polarity: str, pinhole: float) -> Proportions:
        """Return those of a print whose colour and hole are chosen.

        They are the family's where the colour is 'auto' and the hole negative.
        """
        return replace(
            self,
            polarity=self.polarity if polarity == 'auto' else polarity,
            pinhole=self.pinhole if pinhole < 0 else pinhole,
        )


@dataclass(frozen=True, slots=True)
class PrintedDesign:
    """The print of one code word: a point inside an odd number of contours is inked."""

    code: int
    contours: tuple[Contour, ...]


def proportions(name: str, file: str = '') -> Proportions:
    """Return what the targets of a family have in common; `file` is as for `code_family`.

    Examples
    --------
    >>> proportions('metashape12').radii
    {'dot': 1.0, 'band_inner': 2.25, 'band_outer': 3.5}
    """
    if name in SQUARE_NAMES:
        reach, radii = HALF_SIDE * 2**0.5, {'half_side': HALF_SIDE}
        return Proportions(reach=reach, radius=HALF_SIDE, quiet_zone=_QUIET_ZONE, radii=radii)
    code, radius, radii = code_family(name, file), 1.0, {'dot': 1.0}
    if isinstance(code, CircleFamily):
        return Proportions(reach=1.0, radius=radius, quiet_zone=_CCTAG_ZONE, radii=radii)
    pinhole, polarity = 0.0, 'dark'
    if isinstance(code, Family):
        radii |= {'band_inner': code.band_inner, 'band_outer': code.band_outer}
        for number, of in enumerate(code.circles, 1):
            radii |= {f'circle_{number}_inner': of[0], f'circle_{number}_outer': of[1]}
        reach, quiet_zone = code.reach, max(_QUIET_ZONE, _WIDER * code.reach)
        pinhole, polarity = code.pinhole, 'bright' if code.polarity == 'bright' else 'dark'
    elif isinstance(code, DotFamily):
        radii |= {'dot_circle': code.dot_circle, 'small_dot': code.dot_radius}
        radii |= {'ground': code.ground_radius, 'border': code.border_radius}
        reach, quiet_zone = code.border_radius, code.border_radius + _MARGIN
        pinhole = code.pinhole
    else:
        radius = float(code.template_radii[code.reference] / code.dot_radius)
        reach = code.reach / code.dot_radius
        quiet_zone = reach + _MARGIN
    return Proportions(reach, radius, quiet_zone, radii, pinhole, polarity)


@cache
def relative_reach(name: str) -> float:
    """Return the radius of a target, in semi-axes of the ellipse that is reported.

    A target of a family that is not known ends with its ellipse.

    Examples
    --------
    >>> relative_reach('metashape12'), relative_reach('mine')
    (3.5, 1.0)
    """
    if name not in FAMILY_NAMES:
        return 1.0
    design = proportions(name)
    return design.reach / design.radius


def printed_design(name: str, number: int, pinhole: float, file: str = '') -> PrintedDesign:
    """Return the print of the target of a family with an ID; `file` is as for `code_family`.

    `pinhole` is the radius of the hole in the centre of the dot, in radii of the dot, 0 for none;
    square markers, point-distributed targets and CCTags have none. Raise a ValueError if the
    family has no such ID, too.

    Examples
    --------
    >>> len(printed_design('metashape12', 1, 0.05).contours)  # dot, hole, two arcs of the band
    4
    """
    if name in SQUARE_NAMES:
        return PrintedDesign(code=number, contours=tuple(_square_contours(name, number)))
    code = code_family(name, file)
    word = code.word(number)
    if isinstance(code, PointFamily):
        return PrintedDesign(code=word, contours=tuple(_point_contours(code, word)))
    if isinstance(code, CircleFamily):
        radii = code.radii(np.array([word]))[0].tolist()
        return PrintedDesign(code=word, contours=tuple(map(circle, radii)))
    centre = [circle(1.0)] + [circle(pinhole)] * (pinhole > 0)
    if isinstance(code, Family):
        return PrintedDesign(code=word, contours=(*centre, *_band_contours(code, word)))
    return PrintedDesign(code=word, contours=(*centre, *_dot_ring_contours(code, word)))


def circle(radius: float, x: float = 0.0, y: float = 0.0) -> Contour:
    """Return the outline of a circle."""
    return (Arc(x=x, y=y, radius=radius, start=0.0, extent=2 * math.pi),)


def _band_contours(table: Family, word: int) -> list[Contour]:
    """Return the outlines of the arcs of a band; sectors side by side are one arc."""
    inked = sectors(word, table.bits)
    sector = 2 * math.pi / table.bits
    contours: list[Contour] = []
    for first in np.flatnonzero(inked & ~np.roll(inked, 1)).tolist():
        count = int(np.argmin(np.roll(inked, -first)))
        start, extent = first * sector, count * sector
        outer = Arc(x=0.0, y=0.0, radius=table.band_outer, start=start, extent=extent)
        inner = Arc(x=0.0, y=0.0, radius=table.band_inner, start=start + extent, extent=-extent)
        contours.append((outer, inner))
    return contours + [circle(radius) for of in table.circles for radius in of]


def _dot_ring_contours(table: DotFamily, word: int) -> list[Contour]:
    dots = [circle(table.dot_radius, x, y) for x, y in table.places(word).tolist()]
    return [*dots, circle(table.ground_radius), circle(table.border_radius)]


def _point_contours(table: PointFamily, word: int) -> list[Contour]:
    places, radii = table.dots(word)
    dots = np.column_stack([radii, places]) / table.dot_radius
    return [circle(*dot) for dot in dots.tolist()]


def _square_contours(name: str, number: int) -> list[Contour]:
    cells = marker(name, number, 1) == 0
    side = len(cells)
    scale = 2 * HALF_SIDE / side
    return [
        tuple(((x - side / 2) * scale, (side / 2 - y) * scale) for x, y in corners)
        for corners in _outlines(cells)
    ]


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
