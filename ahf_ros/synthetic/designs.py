"""Printed designs of the families."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ahf_ros.codes.dots import DotFamily, dot_family
from ahf_ros.codes.gsi import PointFamily
from ahf_ros.codes.gsi_library import point_family
from ahf_ros.codes.ring import Family, family
from ahf_ros.codes.square import SQUARE_NAMES, dictionary
from ahf_ros.synthetic.covers import Cover, ring_cover, square_cover
from ahf_ros.synthetic.dot_covers import dot_ring_cover, point_cover

_HALF_SIDE = 2.4  # of a square marker, in radii of the dot of a ring target of the same size
_QUIET_ZONE = 4.2  # of ring targets and square markers: 3.5 for the widest band, a fifth more
_MARGIN = 1.0  # about the outermost dot or border of others, in radii of the dot


@dataclass(frozen=True, slots=True)
class Design:
    """A printed target; lengths are in radii of its dot.

    Attributes
    ----------
    code : int
        Code word.
    cover : Cover
        The ink.
    reach : float
        Radius of the circle that holds all ink.
    radius : float
        Radius of the circle whose image is reported as the ellipse of the target.
    """

    code: int
    cover: Cover
    reach: float
    radius: float


def designs(
    name: str, pinhole: float, file: str = ''
) -> tuple[np.ndarray, Callable[[int, float], Design]]:
    """Return the designs of a family.

    Parameters
    ----------
    name : str
        Name of the family.
    pinhole : float
        As for `ring_cover`; square markers and point-distributed targets have none.
    file : str
        Data file that describes the family, of `gsi` and `dots`; the usual one where empty.

    Returns
    -------
    ids : ndarray of int
        All IDs of the family.
    design_of : callable
        From an ID and a counter-clockwise rotation in rad to the `Design`.
    """
    if name in SQUARE_NAMES:
        return np.arange(len(dictionary(name).bytesList)), partial(_square_design, name)
    if name == 'gsi':
        points = point_family(file)
        return points.numbers, partial(_point_design, points)
    if name == 'dots':
        dots = dot_family(file)
        return np.arange(1, dots.words.size + 1), partial(_dot_ring_design, dots, pinhole)
    table = family(name)
    return np.arange(1, table.words.size + 1), partial(_ring_design, table, pinhole)


def _ring_design(table: Family, pinhole: float, number: int, turn: float) -> Design:
    word = table.word(number)
    return Design(word, ring_cover(table, word, turn, pinhole), table.band_outer, 1.0)


def _square_design(name: str, number: int, turn: float) -> Design:
    cover = square_cover(name, number, _HALF_SIDE, turn)
    return Design(number, cover, _HALF_SIDE * 2**0.5, _HALF_SIDE)


def _point_design(table: PointFamily, number: int, turn: float) -> Design:
    word = table.word(number)
    radius = table.template_radii[table.reference] / table.dot_radius
    cover = point_cover(table, word, turn)
    return Design(word, cover, table.reach / table.dot_radius, float(radius))


def _dot_ring_design(table: DotFamily, pinhole: float, number: int, turn: float) -> Design:
    word = table.word(number)
    return Design(word, dot_ring_cover(table, word, turn, pinhole), table.border_radius, 1.0)


def quiet_zone(name: str, file: str = '') -> float:
    """Return the radius of the area around a target that is left free, in radii of the dot.

    Parameters
    ----------
    name, file : str
        As for `designs`.
    """
    if name == 'gsi':
        return point_family(file).reach / point_family(file).dot_radius + _MARGIN
    if name == 'dots':
        return dot_family(file).border_radius + _MARGIN
    return _QUIET_ZONE
