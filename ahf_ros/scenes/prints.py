"""Marks printed on the wall, drawn into the image without aliasing."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.scenes.camera import Camera
from ahf_ros.scenes.covers import Cover

_SUPERSAMPLING = 3  # samples per pixel along each axis
_EDGE = 2.0  # width of a drawn edge, samples; the blur that follows is reduced accordingly
_BLOCK_PIXELS = 1 << 18  # supersampled at a time, to bound the memory


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """Something printed on the wall.

    The radius is the unit of length of `cover`, in units of the wall; for a target, that of its
    dot. A circle of radius `reach`, in radii of the mark, holds all ink.
    """

    centre: np.ndarray  # on the wall, shape (2,)
    radius: float
    reach: float
    cover: Cover


def mark_at(camera: Camera, pixel: np.ndarray, radius: float, reach: float, cover: Cover) -> Mark:
    """Return a mark at a pixel whose radius is `radius` px in the image."""
    centre = camera.wall(pixel[None])[0]
    enlargement = np.linalg.norm(camera.jacobian(centre), ord=2)
    return Mark(centre, float(radius / enlargement), reach, cover)


def print_mark(
    image: np.ndarray, light: np.ndarray, mark: Mark, camera: Camera, change: float, blur: float
) -> None:
    """Draw a mark into an image.

    The light on the ink is supersampled, blurred by the lens and averaged over each pixel.

    `image` is the light that the wall sends to each pixel, float32, modified in place; `light` is
    what a white wall would send. The centre of the mark must be in the image; `change` is the
    reflectance of the ink minus the ground's, `blur` the standard deviation of the lens's, px.
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
        x, y = _points(back, camera, rows, columns)
        inked = mark.cover(x, y, jacobian.astype(np.float32))
        lit = cv2.resize(light[rows, columns], inked.shape[::-1], interpolation=cv2.INTER_CUBIC)
        inked *= lit
        if sigma:
            inked = cv2.GaussianBlur(inked, (0, 0), sigma)
        size = columns.stop - columns.start, rows.stop - rows.start
        added = cv2.resize(inked, size, interpolation=cv2.INTER_AREA) * np.float32(change)
        image[kept, columns] += added[kept.start - rows.start : kept.stop - rows.start]


def _blocks(mark: Mark, camera: Camera, spread: int) -> Iterator[tuple[slice, slice, slice]]:
    """Yield blocks of rows and columns that show a mark, and which rows of each are valid."""
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


def _points(
    back: np.ndarray, camera: Camera, rows: slice, columns: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a mark that a block samples, by a homography from rays to the mark."""
    x, y = camera.rays(_samples(columns)[None, :], _samples(rows)[:, None])
    inverse = 1 / (back[2, 0] * x + (back[2, 1] * y + back[2, 2]))
    across = (back[0, 0] * x + (back[0, 1] * y + back[0, 2])) * inverse
    up = (back[1, 0] * x + (back[1, 1] * y + back[1, 2])) * inverse
    return across.astype(np.float32), up.astype(np.float32)


def _samples(pixels: slice) -> np.ndarray:
    """Return the coordinates of the samples of a range of pixels."""
    count = (pixels.stop - pixels.start) * _SUPERSAMPLING
    return pixels.start - 0.5 + (np.arange(count) + 0.5) / _SUPERSAMPLING
