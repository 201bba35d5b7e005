"""Printed designs of the families, as covers of the wall with ink."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ahf_ros.codes.designs import HALF_SIDE, proportions
from ahf_ros.codes.dots import DotFamily, dot_family
from ahf_ros.codes.gsi import PointFamily, point_family
from ahf_ros.codes.ring import Family, family
from ahf_ros.codes.square import SQUARE_NAMES, dictionary
from ahf_ros.synthetic.covers import (
    Cover,
    dot_share,
    edge_width,
    inside_share,
    ring_cover,
    square_cover,
)

CoverOf = Callable[[int, float, float], tuple[int, Cover]]
"""From an ID, a counter-clockwise rotation in rad and the length by which ink is larger on every
edge, in radii of the dot, to the code word and the ink."""


def point_cover(family: PointFamily, word: int, turn: float, growth: float = 0.0) -> Cover:
    """Return the ink of a point-distributed target.

    Parameters
    ----------
    family : PointFamily
        Printed design; its `dot_radius` is the unit of length.
    word : int
        Value of the code.
    turn : float
        Counter-clockwise rotation about the reference point, rad.
    growth : float
        Length by which the ink is larger on every edge, in units of length.
    """
    places, radii = family.dots(word)
    places, radii = _turned(places, turn) / family.dot_radius, radii / family.dot_radius + growth

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        inked = np.zeros_like(x)
        for place, radius in zip(places, radii, strict=True):
            _add_dot(inked, x, y, place, radius, jacobian)
        return np.minimum(inked, 1, out=inked)

    return cover


def dot_ring_cover(
    family: DotFamily, word: int, turn: float, pinhole: float, growth: float = 0.0
) -> Cover:
    """Return the ink of a ring of dots.

    Parameters
    ----------
    family : DotFamily
        Printed design.
    word : int
        Code word.
    turn : float
        Direction of the place of dot 0, rad.
    pinhole : float
        Radius of the hole in the disc, in radii of the disc; 0 for none.
    growth : float
        Length by which the ink is larger on every edge, in radii of the disc.
    """
    places = family.places(word, turn)
    inner = np.float32(family.ground_radius - growth)
    outer = np.float32(family.border_radius + growth)

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        distance = np.sqrt(x * x + y * y)
        width = edge_width(jacobian, x, y, distance)
        inked = dot_share(distance, width, pinhole, growth)
        border = inside_share(distance - inner, width)
        border *= inside_share(outer - distance, width)
        inked += border
        for place in places:
            _add_dot(inked, x, y, place, family.dot_radius + growth, jacobian)
        return np.minimum(inked, 1, out=inked)

    return cover


def _turned(points: np.ndarray, turn: float) -> np.ndarray:
    """Return points rotated counter-clockwise about the origin."""
    cosine, sine = math.cos(turn), math.sin(turn)
    turned: np.ndarray = points @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def _add_dot(
    inked: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    place: np.ndarray,
    radius: float,
    jacobian: np.ndarray,
) -> None:
    """Add the ink of a dot to samples."""
    across, up = x - np.float32(place[0]), y - np.float32(place[1])
    near = np.maximum(np.abs(across), np.abs(up)) < radius + 2 * np.abs(jacobian).sum()
    across, up = across[near], up[near]
    distance = np.sqrt(across * across + up * up)
    width = edge_width(jacobian, across, up, distance)
    inked[near] += inside_share(np.float32(radius) - distance, width)


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
) -> tuple[np.ndarray, Callable[[int, float, float], Design]]:
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
        From an ID, a counter-clockwise rotation in rad, and the length by which the ink is larger
        on every edge, in radii of the dot, to the `Design`.
    """
    ids, cover_of = _covers(name, pinhole, file)
    common = proportions(name, file)

    def design_of(number: int, turn: float, growth: float) -> Design:
        reach = common.reach + max(growth, 0.0)
        return Design(*cover_of(number, turn, growth), reach, common.radius)

    return ids, design_of


def _covers(name: str, pinhole: float, file: str) -> tuple[np.ndarray, CoverOf]:
    if name in SQUARE_NAMES:
        return np.arange(len(dictionary(name).bytesList)), partial(_square_cover, name)
    if name == 'gsi':
        points = point_family(file)
        return points.numbers, partial(_point_cover, points)
    if name == 'dots':
        dots = dot_family(file)
        return np.arange(1, dots.words.size + 1), partial(_dot_ring_cover, dots, pinhole)
    table = family(name)
    return np.arange(1, table.words.size + 1), partial(_ring_cover, table, pinhole)


def _ring_cover(
    table: Family, pinhole: float, number: int, turn: float, growth: float
) -> tuple[int, Cover]:
    word = table.word(number)
    return word, ring_cover(table, word, turn, pinhole, growth)


def _square_cover(name: str, number: int, turn: float, growth: float) -> tuple[int, Cover]:
    return number, square_cover(name, number, HALF_SIDE, turn, growth)


def _point_cover(table: PointFamily, number: int, turn: float, growth: float) -> tuple[int, Cover]:
    word = table.word(number)
    return word, point_cover(table, word, turn, growth)


def _dot_ring_cover(
    table: DotFamily, pinhole: float, number: int, turn: float, growth: float
) -> tuple[int, Cover]:
    word = table.word(number)
    return word, dot_ring_cover(table, word, turn, pinhole, growth)
