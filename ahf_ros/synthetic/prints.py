"""What is printed on the wall: the reflectance of ring targets, without aliasing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.codes.ring import Family, sectors
from ahf_ros.synthetic.camera import Camera

SUPERSAMPLING = 3
"""Samples a pixel and axis, each of them anti-aliased by its distance to the edges."""


@dataclass(frozen=True, slots=True, eq=False)
class Print:
    """One ring target on the wall.

    Attributes
    ----------
    number : int
        ID of the code.
    word : int
        Code word, canonical.
    centre : ndarray of float64, shape (2,)
        On the wall.
    radius : float
        Radius of the dot, units of the wall.
    turn : float
        Direction of the edge before sector 0, rad, counter-clockwise as seen, from the wall's x.
    """

    number: int
    word: int
    centre: np.ndarray
    radius: float
    turn: float


@dataclass(frozen=True, slots=True, eq=False)
class Ink:
    """Which part of a block of pixels is covered with the colour of the dot.

    Attributes
    ----------
    rows, columns : slice
        The block in the image.
    cover : ndarray of float32
        0 to 1, `SUPERSAMPLING` samples a pixel and axis.
    """

    rows: slice
    columns: slice
    cover: np.ndarray


def ink(printed: Print, family: Family, pinhole: float, camera: Camera, margin: float) -> Ink:
    """Return the ink of a target as the camera sees it, without blur.

    The signed distance to each edge, in samples, gives the share of a sample that is covered.

    Parameters
    ----------
    printed : Print
        The target.
    family : Family
        Gives the proportions and the number of sectors.
    pinhole : float
        Radius of the hole in the middle of the dot, in radii of the dot; 0 for none.
    camera : Camera
        Sees the target whole.
    margin : float
        What the block shows beyond the band, px.
    """
    rows, columns = _block(printed, family.band_outer, camera, margin)
    x, y = _print_coordinates(printed, camera, rows, columns)
    jacobian = np.linalg.inv(camera.jacobian(printed.centre)) / printed.radius
    distance = np.sqrt(x * x + y * y)
    radial = _width(jacobian, x, y) / np.maximum(distance, np.float32(1e-6))

    cover = _inside(1 - distance, radial)
    if pinhole:
        cover -= _inside(pinhole - distance, radial)
    reach = np.float32(3 * radial.max())
    band = (distance > family.band_inner - reach) & (distance < family.band_outer + reach)
    distance, radial, x, y = distance[band], radial[band], x[band], y[band]
    ring = _inside(distance - family.band_inner, radial)
    ring *= _inside(family.band_outer - distance, radial)
    around = _width(jacobian, -y, x) / np.maximum(distance, np.float32(1e-6))
    ring *= _sector_cover(printed, family.bits, x, y, distance, around)
    cover[band] += ring
    return Ink(rows, columns, cover)


def _block(
    printed: Print, outer: float, camera: Camera, margin: float
) -> tuple[slice, slice]:
    """Return the rows and columns of the pixels that the band and a margin fill."""
    angles = np.linspace(0, 2 * math.pi, 64, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1) * outer * printed.radius
    pixels = camera.project(printed.centre + circle)
    low = np.floor(pixels.min(axis=0) - margin).astype(int)
    high = np.ceil(pixels.max(axis=0) + margin).astype(int) + 1
    low = np.maximum(low, 0)
    high = np.minimum(high, (camera.width, camera.height))
    return slice(low[1], high[1]), slice(low[0], high[0])


def _print_coordinates(
    printed: Print, camera: Camera, rows: slice, columns: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples' places relative to the target, in radii of the dot, float32."""
    x, y = camera.rays(_samples(columns)[None, :], _samples(rows)[:, None])
    back = np.linalg.inv(camera.pose)
    back[:2] -= np.outer(printed.centre, back[2])
    back[:2] /= printed.radius
    inverse = 1 / (back[2, 0] * x + (back[2, 1] * y + back[2, 2]))
    return tuple(
        ((row[0] * x + (row[1] * y + row[2])) * inverse).astype(np.float32) for row in back[:2]
    )


def _samples(pixels: slice) -> np.ndarray:
    """Return the coordinates of the samples of a run of pixels."""
    count = (pixels.stop - pixels.start) * SUPERSAMPLING
    return pixels.start - 0.5 + (np.arange(count) + 0.5) / SUPERSAMPLING


def _width(jacobian: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the size of a sample along (x, y), times the length of (x, y)."""
    form = np.float32(jacobian @ jacobian.T / SUPERSAMPLING**2)
    return np.sqrt(x * (form[0, 0] * x + 2 * form[0, 1] * y) + form[1, 1] * y * y)


def _inside(distance: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the share of samples of a width that lies on the positive side of an edge."""
    share = distance / np.maximum(width, np.float32(1e-9)) + np.float32(0.5)
    return np.clip(share, 0, 1, out=share)


def _sector_cover(
    printed: Print,
    bits: int,
    x: np.ndarray,
    y: np.ndarray,
    distance: np.ndarray,
    width: np.ndarray,
) -> np.ndarray:
    """Return the share of each sample in the band that its sectors cover."""
    angle = np.arctan2(-y, x) - np.float32(printed.turn)
    position = angle * np.float32(bits / (2 * math.pi))
    edge = np.rint(position)
    past = (position - edge) * np.float32(2 * math.pi / bits) * distance
    share = _inside(past, width)
    colours = sectors(printed.word, bits).astype(np.float32)
    after = edge.astype(np.int32) % bits
    return colours[after] * share + colours[after - 1] * (1 - share)


def apply_ink(
    light: np.ndarray, marks: Ink, ground: float, ink_reflectance: float, blur: float
) -> np.ndarray:
    """Return the pixels of a block whose light falls on a printed ground, seen through a lens.

    Parameters
    ----------
    light : ndarray of float32
        Light on the block, a value a pixel.
    marks : Ink
        Of the block.
    ground, ink_reflectance : float
        Reflectance without and with ink.
    blur : float
        Standard deviation of the lens's blur, px.
    """
    height, width = marks.cover.shape
    samples = cv2.resize(light, (width, height), interpolation=cv2.INTER_CUBIC)
    samples *= ground + np.float32(ink_reflectance - ground) * marks.cover
    if blur:
        sigma = blur * SUPERSAMPLING
        samples = cv2.GaussianBlur(samples, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    return cv2.resize(samples, light.shape[::-1], interpolation=cv2.INTER_AREA)
