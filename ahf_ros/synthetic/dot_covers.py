"""Printed designs that are made of dots: point-distributed targets and rings of dots."""

from __future__ import annotations

import math

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.codes.gsi import PointFamily
from ahf_ros.synthetic.covers import Cover, dot_share, edge_width, inside_share


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
