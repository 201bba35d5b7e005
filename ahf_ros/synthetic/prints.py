"""What is printed on the wall, put into the image without aliasing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.codes.ring import Family, sectors
from ahf_ros.codes.square import marker
from ahf_ros.synthetic.camera import Camera

_SUPERSAMPLING = 3  # samples a pixel and axis
_EDGE = 2.0  # samples that an edge is spread over, which takes off the blur that follows
_CELL = 32  # px of the picture of a square marker
_BLOCK_PIXELS = 1 << 18  # supersampled at a time

Cover = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Ink, 0 to 1, at places (x, y) of a mark, float32 of one shape in units of the mark's radius.

y is up, so that angles are counter-clockwise as seen. The third argument, shape (2, 2), is the
change of place over the width of an anti-aliased edge along the columns and the rows.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """Something printed on the wall.

    Attributes
    ----------
    centre : ndarray of float64, shape (2,)
        On the wall.
    radius : float
        Unit of length of `cover`, in units of the wall; the dot's radius for a target.
    reach : float
        Radius that holds all ink, in radii of the mark.
    cover : Cover
        Where the ink is.
    """

    centre: np.ndarray
    radius: float
    reach: float
    cover: Cover


def ring_cover(family: Family, word: int, turn: float, pinhole: float) -> Cover:
    """Return the ink of a ring target.

    The signed distance to each edge, in widths of an anti-aliased edge, gives the share of a
    sample that is covered.

    Parameters
    ----------
    family : Family
        Gives the proportions and the number of sectors.
    word : int
        Code word.
    turn : float
        Direction of the edge before sector 0, rad.
    pinhole : float
        Radius of the hole in the middle of the dot, in radii of the dot; 0 for none.
    """

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        distance = np.sqrt(x * x + y * y)
        radial = _width(jacobian, x, y, distance)
        inked = _inside(1 - distance, radial)
        if pinhole:
            inked -= _inside(pinhole - distance, radial)
        margin = np.float32(2 * radial.max())
        band = (distance > family.band_inner - margin) & (distance < family.band_outer + margin)
        distance, radial, x, y = distance[band], radial[band], x[band], y[band]
        ring = _inside(distance - np.float32(family.band_inner), radial)
        ring *= _inside(np.float32(family.band_outer) - distance, radial)
        around = _width(jacobian, -y, x, distance) / distance
        ring *= _sector_cover(sectors(word, family.bits), np.arctan2(y, x) - turn, around)
        inked[band] += ring
        return inked

    return cover


def square_cover(name: str, number: int, half_side: float, turn: float) -> Cover:
    """Return the ink of a square marker.

    Parameters
    ----------
    name : str
        Dictionary, one of `ahf_ros.codes.square.SQUARE_NAMES`.
    number : int
        ID of the marker.
    half_side : float
        Half of its side, in radii of the mark.
    turn : float
        Direction that its upper side is turned by, rad.
    """
    ink = 255 - marker(name, number, _CELL)
    side = len(ink)
    ink = np.pad(ink, _CELL)
    return stamp_cover(ink, half_side * len(ink) / side, turn)


def stamp_cover(stamp: np.ndarray, half_side: float, turn: float) -> Cover:
    """Return the ink of a picture.

    Parameters
    ----------
    stamp : ndarray of uint8, shape (side, side)
        255 where there is ink.
    half_side : float
        Half of its side, in radii of the mark.
    turn : float
        Direction that its upper side is turned by, rad.
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


def print_mark(
    image: np.ndarray, light: np.ndarray, mark: Mark, camera: Camera, change: float, blur: float
) -> None:
    """Add to an image what the ink of a mark changes.

    Light times ink is supersampled, blurred by the lens and averaged over each pixel.

    Parameters
    ----------
    image : ndarray of float32, shape (height, width)
        Light that the wall sends to each pixel; changed in place.
    light : ndarray of float32, shape (height, width)
        Light that a white wall would send.
    mark : Mark
        At least its centre is in the image.
    camera : Camera
        Sees the mark.
    change : float
        Reflectance of the ink less that of the ground.
    blur : float
        Standard deviation of the lens's blur, px.
    """
    sigma, edge = blur * _SUPERSAMPLING, 1.0
    if sigma >= 1:
        sigma, edge = math.sqrt(sigma**2 - (_EDGE**2 - 1) / 12), _EDGE
    spread = math.ceil(4 * blur) + 1
    back = np.linalg.inv(camera.pose)
    back[:2] -= np.outer(mark.centre, back[2])
    back[:2] /= np.array([[mark.radius], [-mark.radius]])
    jacobian = np.linalg.inv(camera.jacobian(mark.centre)) * edge / mark.radius / _SUPERSAMPLING
    jacobian[1] *= -1
    for rows, columns, kept in _blocks(mark, camera, spread):
        x, y = _places(back, camera, rows, columns)
        inked = mark.cover(x, y, jacobian.astype(np.float32))
        lit = cv2.resize(light[rows, columns], inked.shape[::-1], interpolation=cv2.INTER_CUBIC)
        inked *= lit
        if sigma:
            inked = cv2.GaussianBlur(inked, (0, 0), sigma)
        size = columns.stop - columns.start, rows.stop - rows.start
        added = cv2.resize(inked, size, interpolation=cv2.INTER_AREA) * np.float32(change)
        image[kept, columns] += added[kept.start - rows.start : kept.stop - rows.start]


def _blocks(mark: Mark, camera: Camera, spread: int) -> Iterator[tuple[slice, slice, slice]]:
    """Yield blocks of rows and columns that show a mark, and the rows of each to be kept."""
    angles = np.linspace(0, 2 * math.pi, 64, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1) * mark.reach * mark.radius
    pixels = camera.project(mark.centre + circle)
    size = np.array([camera.width, camera.height])
    left, top = np.clip(np.floor(pixels.min(axis=0) - spread).astype(int), 0, size)
    right, bottom = np.clip(np.ceil(pixels.max(axis=0) + spread + 1).astype(int), 0, size)
    height = max(_BLOCK_PIXELS // (right - left), 4 * spread)
    for start in range(top, bottom, height):
        stop = min(start + height, bottom)
        rows = slice(max(start - spread, 0), min(stop + spread, camera.height))
        yield rows, slice(left, right), slice(start, stop)


def _places(
    back: np.ndarray, camera: Camera, rows: slice, columns: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the samples of a block, through a homography from rays to places."""
    x, y = camera.rays(_samples(columns)[None, :], _samples(rows)[:, None])
    inverse = 1 / (back[2, 0] * x + (back[2, 1] * y + back[2, 2]))
    across = (back[0, 0] * x + (back[0, 1] * y + back[0, 2])) * inverse
    up = (back[1, 0] * x + (back[1, 1] * y + back[1, 2])) * inverse
    return across.astype(np.float32), up.astype(np.float32)


def _samples(pixels: slice) -> np.ndarray:
    """Return the coordinates of the samples of a run of pixels."""
    count = (pixels.stop - pixels.start) * _SUPERSAMPLING
    return pixels.start - 0.5 + (np.arange(count) + 0.5) / _SUPERSAMPLING


def _width(jacobian: np.ndarray, x: np.ndarray, y: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return the width of an edge across (x, y), a vector of length `distance`."""
    form = jacobian @ jacobian.T
    squared = x * (form[0, 0] * x + 2 * form[0, 1] * y) + form[1, 1] * y * y
    width: np.ndarray = np.sqrt(squared) / np.maximum(distance, np.float32(1e-6))
    return np.maximum(width, np.float32(1e-6), out=width)


def _inside(distance: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the share of samples on the positive side of an edge of a width."""
    share: np.ndarray = distance / width + np.float32(0.5)
    return np.clip(share, 0, 1, out=share)


def _sector_cover(colours: np.ndarray, angle: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the share of samples that inked sectors cover, for edges `width` rad wide."""
    bits = len(colours)
    position = angle * np.float32(bits / (2 * math.pi))
    edge = np.rint(position)
    share = _inside((position - edge) * np.float32(2 * math.pi / bits), width)
    after = edge.astype(np.int32) % bits
    shades = colours.astype(np.float32)
    cover: np.ndarray = shades[after] * share + shades[after - 1] * (1 - share)
    return cover
