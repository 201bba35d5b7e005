"""The ink of printed targets, as functions of the place."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np

from ahf_ros.codes.ring import Family, sectors
from ahf_ros.codes.square import marker

_CELL = 32  # side of a cell in the picture of a square marker, px

Cover = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From points (x, y) of a mark, float32 of one shape in units of its radius, to the ink, 0 to 1.

y points up, so that angles are counter-clockwise in the image. The third argument, shape (2, 2),
is the change of (x, y) across the width of an anti-aliased edge, along the columns and the rows.
"""


def ring_cover(
    family: Family, word: int, turn: float, pinhole: float, growth: float = 0.0
) -> Cover:
    """Return the ink of a ring target.

    The signed distance to each edge, in widths of an anti-aliased edge, gives the covered
    fraction of a sample.

    Parameters
    ----------
    family : Family
        Family with the proportions and the number of sectors.
    word : int
        Code word.
    turn : float
        Direction of the edge at which sector 0 begins, rad.
    pinhole : float
        Radius of the hole in the centre of the dot, in radii of the dot; 0 for none.
    growth : float
        Length by which the ink is larger on every edge, in radii of the dot; less than half of a
        sector.
    """
    inner, outer = np.float32(family.band_inner - growth), np.float32(family.band_outer + growth)

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        distance = np.sqrt(x * x + y * y)
        radial = edge_width(jacobian, x, y, distance)
        inked = dot_share(distance, radial, pinhole, growth)
        margin = np.float32(2 * radial.max())
        band = (distance > inner - margin) & (distance < outer + margin)
        distance, radial, x, y = distance[band], radial[band], x[band], y[band]
        ring = inside_share(distance - inner, radial)
        ring *= inside_share(outer - distance, radial)
        around = edge_width(jacobian, -y, x, distance) / distance
        angle, wider = np.arctan2(y, x) - turn, np.float32(growth) / distance
        ring *= _sector_cover(sectors(word, family.bits), angle, around, wider)
        inked[band] += ring
        return inked

    return cover


def square_cover(
    name: str, number: int, half_side: float, turn: float, growth: float = 0.0
) -> Cover:
    """Return the ink of a square marker.

    Parameters
    ----------
    name : str
        Name of the dictionary, one of `ahf_ros.codes.square.SQUARE_NAMES`.
    number : int
        ID of the marker.
    half_side : float
        Half the side of the marker, in radii of the mark.
    turn : float
        Rotation of the marker, counter-clockwise, rad.
    growth : float
        Length by which the ink is larger on every edge, in radii of the mark; less than a cell.
    """
    ink = 255 - marker(name, number, _CELL)
    side = len(ink)
    ink = _grown(np.pad(ink, _CELL), growth * side / (2 * half_side))
    return stamp_cover(ink, half_side * len(ink) / side, turn)


def card_cover(half_width: float, turn: float) -> Cover:
    """Return a regular octagon, turned counter-clockwise by an angle in rad."""
    cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        width = np.float32(np.sqrt(abs(np.linalg.det(jacobian))))
        across, up = np.abs(x * cosine + y * sine), np.abs(y * cosine - x * sine)
        outermost = np.maximum(np.maximum(across, up), (across + up) * np.float32(math.sqrt(0.5)))
        return inside_share(np.float32(half_width) - outermost, width)

    return cover


def stamp_cover(stamp: np.ndarray, half_side: float, turn: float) -> Cover:
    """Return the ink of a picture.

    Parameters
    ----------
    stamp : ndarray of uint8, shape (side, side)
        255 where there is ink.
    half_side : float
        Half the side of the picture, in radii of the mark.
    turn : float
        Rotation of the picture, counter-clockwise, rad.
    """
    cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
    half = np.float32(len(stamp) / 2)
    scale = half / np.float32(half_side)
    ink = stamp.astype(np.float32) / np.float32(255)

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        sample = float(np.sqrt(abs(np.linalg.det(jacobian)))) * float(scale)
        smooth = cv2.GaussianBlur(ink, (0, 0), max(sample / 2, 0.5))
        columns = (x * cosine + y * sine) * scale + (half - np.float32(0.5))
        rows = (x * sine - y * cosine) * scale + (half - np.float32(0.5))
        return cv2.remap(smooth, columns, rows, cv2.INTER_LINEAR)

    return cover


def edge_width(
    jacobian: np.ndarray, x: np.ndarray, y: np.ndarray, distance: np.ndarray
) -> np.ndarray:
    """Return the width of an edge perpendicular to (x, y), a vector of length `distance`."""
    form = jacobian @ jacobian.T
    squared = x * (form[0, 0] * x + 2 * form[0, 1] * y) + form[1, 1] * y * y
    width: np.ndarray = np.sqrt(squared) / np.maximum(distance, np.float32(1e-6))
    return np.maximum(width, np.float32(1e-6), out=width)


def inside_share(distance: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the fraction of each sample on the positive side of an edge."""
    share: np.ndarray = distance / width + np.float32(0.5)
    return np.clip(share, 0, 1, out=share)


def dot_share(
    distance: np.ndarray, width: np.ndarray, pinhole: float, growth: float
) -> np.ndarray:
    """Return the fraction of each sample that a dot of radius 1 covers.

    Parameters
    ----------
    distance : ndarray of float32
        Of the samples from its centre, in its radii.
    width : ndarray of float32
        Of its edge, in its radii.
    pinhole, growth : float
        As for `ring_cover`.
    """
    inked = inside_share(np.float32(1 + growth) - distance, width)
    if pinhole:
        inked -= inside_share(np.float32(pinhole - growth) - distance, width)
    return inked


def _grown(ink: np.ndarray, growth: float) -> np.ndarray:
    """Return a picture of ink, 255, that is larger by a length in px on every edge."""
    inside, outside = (
        cv2.distanceTransform(where.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for where in (ink > 0, ink == 0)
    )
    beyond = np.where(ink > 0, inside - 0.5, 0.5 - outside) + growth  # an edge is between pixels
    return np.rint(inside_share(beyond, np.float32(1)) * 255).astype(np.uint8)


def _sector_cover(
    colours: np.ndarray, angle: np.ndarray, width: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Return the fraction of each sample that inked sectors cover; angles are in rad.

    Parameters
    ----------
    colours : ndarray of bool, shape (bits,)
    angle, width, growth : ndarray of float32
        Angle of each sample, width of an edge there, and length by which ink is wider there, less
        than half of a sector.
    """
    bits = len(colours)
    position = angle * np.float32(bits / (2 * math.pi))
    edge = np.rint(position)
    after = edge.astype(np.int32) % bits
    shades = colours.astype(np.float32)
    beyond = (position - edge) * np.float32(2 * math.pi / bits)
    share = inside_share(beyond + growth * (shades[after] - shades[after - 1]), width)
    cover: np.ndarray = shades[after] * share + shades[after - 1] * (1 - share)
    return cover
