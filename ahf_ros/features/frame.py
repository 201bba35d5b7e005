"""Frames of circular targets: maps from the target's plane to the image.

A frame is a homography, 3 x 3, from the plane of a target (dot radius 1, centre at the origin, the
y axis pointing down) to pixels. All concentric circles of the target share it, so that measured
displacements of their edges improve it by one linear least-squares problem: a circle of radius r
that is displaced by the small frame change (t, E, p) moves outwards by

    dr = t . u + r u . E u - r^2 p . u,        u = (cos a, sin a),

with the translation t, the symmetric strain E and the projective part p. Circles of two radii
separate t from p; with one, p is left alone and t carries the perspective bias.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

_NO_MAP: Any = None  # coordinates come as pairs in one map
_REMAP_ROWS = 16384  # cv2.remap takes maps of at most 32767 rows


def affine_frames(
    x: np.ndarray,
    y: np.ndarray,
    semi_major: np.ndarray,
    semi_minor: np.ndarray,
    angle: np.ndarray,
) -> np.ndarray:
    """Return the frames that map the unit circle onto ellipses.

    Parameters
    ----------
    x, y, semi_major, semi_minor : array_like of float, shape (k,)
        Centres and semi-axes, px.
    angle : array_like of float, shape (k,)
        Direction of the major axis from +x towards +y, rad.

    Returns
    -------
    ndarray of float64, shape (k, 3, 3)
    """
    x, y, major, minor, angle = np.broadcast_arrays(
        *(np.asarray(values, np.float64) for values in (x, y, semi_major, semi_minor, angle))
    )
    cosine, sine = np.cos(angle), np.sin(angle)
    frames = np.zeros((x.size, 3, 3))
    frames[:, 0, 0] = major * cosine**2 + minor * sine**2
    frames[:, 1, 1] = major * sine**2 + minor * cosine**2
    frames[:, 0, 1] = frames[:, 1, 0] = (major - minor) * cosine * sine
    frames[:, 0, 2], frames[:, 1, 2], frames[:, 2, 2] = x, y, 1.0
    return frames


def circle_points(angles: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return points on concentric circles.

    Parameters
    ----------
    angles : ndarray of float, shape (m,)
        From +x towards +y, rad.
    radii : ndarray of float, shape (..., n)
        In dot radii.

    Returns
    -------
    ndarray of float64, shape (..., m, n, 2)
    """
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return radii[..., None, :, None] * directions[:, None, :]


def project(frames: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the images of points of the target's plane.

    Parameters
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    points : ndarray of float, shape (..., 2) of up to three axes, or (k, m, n, 2)
        The same points for every frame, or those of each.

    Returns
    -------
    ndarray of float64, shape (k, ..., 2)
        Pixels.
    """
    spread = (slice(None),) + (None,) * (points.ndim - 1 - (points.ndim > 3))
    x, y = points[..., 0], points[..., 1]
    rows = [[element[spread] for element in row.T] for row in frames.transpose(1, 0, 2)]
    across, down, scale = (row[0] * x + row[1] * y + row[2] for row in rows)
    images = np.empty((*across.shape, 2))
    np.divide(across, scale, out=images[..., 0])
    np.divide(down, scale, out=images[..., 1])
    return images


def sample(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the bilinearly interpolated values of an image.

    Parameters
    ----------
    image : ndarray of uint8, uint16, int16 or float32, shape (height, width)
    pixels : ndarray of float, shape (..., 2)
        Beyond the border the nearest pixel counts.

    Returns
    -------
    ndarray of the image's dtype, shape (...)
    """
    columns = pixels.shape[-2]
    maps = np.ascontiguousarray(pixels, np.float32).reshape(-1, columns, 2)
    values = np.empty(maps.shape[:2], image.dtype)
    for start in range(0, len(maps), _REMAP_ROWS):
        rows = slice(start, start + _REMAP_ROWS)
        values[rows] = cv2.remap(
            image, maps[rows], _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return values.reshape(pixels.shape[:-1])


def sample_lines(
    image: np.ndarray, middles: np.ndarray, directions: np.ndarray, along: np.ndarray
) -> np.ndarray:
    """Return the values of an image on straight lines, as `sample` does.

    Parameters
    ----------
    image : ndarray of uint8, uint16, int16 or float32, shape (height, width)
    middles : ndarray of float, shape (k, 2)
        px.
    directions : ndarray of float, shape (k, 2)
        Unit vectors.
    along : ndarray of float, shape (n,)
        Distances from the middle, px.

    Returns
    -------
    ndarray of the image's dtype, shape (k, n)
    """
    x, y = middles.T.astype(np.float32)[..., None]
    across, down = directions.T.astype(np.float32)[..., None]
    along = along.astype(np.float32)
    values = np.empty((len(middles), len(along)), image.dtype)
    for start in range(0, len(values), _REMAP_ROWS):
        rows = slice(start, start + _REMAP_ROWS)
        values[rows] = cv2.remap(
            image,
            x[rows] + across[rows] * along,
            y[rows] + down[rows] * along,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    return values


def sample_circles(
    image: np.ndarray, frames: np.ndarray, angles: np.ndarray, radii: np.ndarray
) -> np.ndarray:
    """Return the values of an image on concentric circles of targets.

    It does what `sample` does for the projected `circle_points`, in single precision and in parts
    that stay in the cache.

    Parameters
    ----------
    image : ndarray of uint8, uint16, int16 or float32, shape (height, width)
    frames : ndarray of float64, shape (k, 3, 3)
    angles : ndarray of float, shape (m,)
        From +x towards +y, rad.
    radii : ndarray of float, shape (n,) or (k, n)
        The same for every frame, or those of each, dot radii.

    Returns
    -------
    ndarray of the image's dtype, shape (k, m, n)
    """
    directions = np.stack([np.cos(angles), np.sin(angles)])
    radii = np.broadcast_to(radii, (len(frames), np.shape(radii)[-1])).astype(np.float32)
    values = np.empty((len(frames), len(angles), radii.shape[1]), image.dtype)
    step = max(1, _REMAP_ROWS // len(angles))
    for start in range(0, len(frames), step):
        part = slice(start, start + step)
        along = (frames[part, :, :2] @ directions).astype(np.float32)[..., None]
        centre = frames[part, :, 2].astype(np.float32)[..., None, None]
        lengths = radii[part, None, :]
        across, down, scale = (centre[:, row] + along[:, row] * lengths for row in range(3))
        rows = across.size // radii.shape[1]
        values[part] = cv2.remap(
            image,
            (across / scale).reshape(rows, -1),
            (down / scale).reshape(rows, -1),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        ).reshape(across.shape)
    return values


def within(pixels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return whether pixels, shape (..., 2), lie in an image of shape (height, width)."""
    x, y = pixels[..., 0], pixels[..., 1]
    return (x >= 0) & (y >= 0) & (x <= shape[1] - 1) & (y <= shape[0] - 1)


@dataclass(frozen=True, slots=True)
class CircleGeometry:
    """Where m points of circles are in the images of k targets, and how the circles run there.

    Attributes
    ----------
    points : ndarray of float64, shape (k, m, 2)
        px.
    normals : ndarray of float64, shape (k, m, 2)
        Unit vectors outwards.
    scale : ndarray of float64, shape (k, m)
        How far the circle moves along its normal where its radius grows, px a dot radius.
    stretch : ndarray of float64, shape (k, m)
        Length of the circle in the image, px a dot radius.
    curvature : ndarray of float64, shape (k, m)
        Of the circle's image, 1/px.
    """

    points: np.ndarray
    normals: np.ndarray
    scale: np.ndarray
    stretch: np.ndarray
    curvature: np.ndarray


def circle_geometry(frames: np.ndarray, angles: np.ndarray, radii: np.ndarray) -> CircleGeometry:
    """Return the geometry of points of circles.

    Parameters
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    angles, radii : ndarray of float, shape (m,)
        Of the points, rad and dot radii.
    """
    radial = np.stack([np.cos(angles), np.sin(angles)])
    tangential = np.stack([-radial[1], radial[0]])
    images = frames[:, :, :2] @ (radii * radial) + frames[:, :, 2:]
    depth = images[:, 2:]
    points = images[:, :2] / depth
    outwards, along = (
        (moved[:, :2] - points * moved[:, 2:]) / depth
        for moved in (frames[:, :, :2] @ radial, frames[:, :, :2] @ tangential)
    )
    stretch = np.hypot(along[:, 0], along[:, 1])
    area = outwards[:, 0] * along[:, 1] - outwards[:, 1] * along[:, 0]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=2) / stretch[..., None]
    return CircleGeometry(
        points.transpose(0, 2, 1), normals, area / stretch, stretch, area / (radii * stretch**3)
    )


def displacement_basis(angles: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return how far each frame change moves an edge outwards, in dot radii.

    Parameters
    ----------
    angles, radii : ndarray of float, shape (m,)
        Where on the target the edges are, rad and dot radii.

    Returns
    -------
    ndarray of float64, shape (m, 7)
        Columns: translation x, y; strain 1, cos 2a, sin 2a; projective x, y.
    """
    cosine, sine = np.cos(angles), np.sin(angles)
    return np.stack(
        [
            cosine,
            sine,
            radii,
            radii * np.cos(2 * angles),
            radii * np.sin(2 * angles),
            -(radii**2) * cosine,
            -(radii**2) * sine,
        ],
        axis=-1,
    )


def moved(frames: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Return frames after small changes, as `displacement_basis` orders them.

    Parameters
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    changes : ndarray of float64, shape (k, 5) or (k, 7)

    Returns
    -------
    ndarray of float64, shape (k, 3, 3)
        Scaled so that the last element is one.
    """
    change = np.zeros_like(frames)
    change[:, 0, 0] = 1 + changes[:, 2] + changes[:, 3]
    change[:, 1, 1] = 1 + changes[:, 2] - changes[:, 3]
    change[:, 0, 1] = change[:, 1, 0] = changes[:, 4]
    change[:, :2, 2] = changes[:, :2]
    change[:, 2, : changes.shape[1] - 5] = changes[:, 5:]
    change[:, 2, 2] = 1.0
    product = frames @ change
    return product / product[:, 2:, 2:]


def enlarged(frames: np.ndarray, level: int) -> np.ndarray:
    """Return frames in the pixels of the image that was halved `level` times to give theirs."""
    scale = 2.0**level
    larger = frames.copy()
    larger[:, :2] = scale * frames[:, :2] + (scale - 1) / 2 * frames[:, 2:]
    return larger


def ellipse_axes(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the semi-axes of the dots and the direction of the major ones.

    Parameters
    ----------
    frames : ndarray of float64, shape (k, 3, 3)

    Returns
    -------
    semi_major, semi_minor : ndarray of float64, shape (k,)
        px, of the affine part of the frame at its centre.
    angle : ndarray of float64, shape (k,)
        rad in (-pi/2, pi/2], from +x towards +y.
    """
    affine = local_affine(frames)
    square = affine @ affine.transpose(0, 2, 1)
    mean = (square[:, 0, 0] + square[:, 1, 1]) / 2
    difference = (square[:, 0, 0] - square[:, 1, 1]) / 2
    deviation = np.hypot(difference, square[:, 0, 1])
    angle = np.arctan2(square[:, 0, 1], difference) / 2
    return np.sqrt(mean + deviation), np.sqrt(np.maximum(mean - deviation, 0)), angle


def mean_radii(frames: np.ndarray) -> np.ndarray:
    """Return the radii of circles with the areas of the dots, px, shape (k,)."""
    major, minor, _ = ellipse_axes(frames)
    return np.sqrt(major * minor)


def local_affine(frames: np.ndarray) -> np.ndarray:
    """Return the derivatives of the frames' maps at the centre, shape (k, 2, 2), px a radius."""
    return frames[:, :2, :2] - frames[:, :2, 2:] * frames[:, 2:, :2]
