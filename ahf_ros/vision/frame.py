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

import numpy as np

# Standard deviation of what pixels and interpolation do to a centre, px. With 0, 0.001, 0.002 and
# 0.003 px, e' C^-1 e of 374 square markers in rendered scenes is 1.8, 1.6, 1.3 and 1.1 on average,
# of 57 CCTags 2.3, 2.1, 1.8 and 1.4.
_SYSTEMATIC = 0.001
_CORNERS = 32  # of the polygon of an outline

# The changes of `changed` that circles show: none of them turns the plane.
_OF_CIRCLES = np.eye(8)[[0, 1, 2, 2, 3, 6, 7]]
_OF_CIRCLES[[2, 3, 4], [5, 5, 4]] = 1, -1, 1


def affine_frames(
    x: np.ndarray,
    y: np.ndarray,
    semi_major: np.ndarray,
    semi_minor: np.ndarray,
    angle: np.ndarray,
) -> np.ndarray:
    """Return the frames, shape (k, 3, 3), that map the unit circle onto ellipses.

    Centres and semi-axes, px, and directions of the major axis from +x towards +y, rad, are
    numbers or of shape (k,).
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
    """Return points on concentric circles, shape (..., m, n, 2).

    Angles, shape (m,), are from +x towards +y, rad; radii, shape (..., n), are dot radii.
    """
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return radii[..., None, :, None] * directions[:, None, :]


def circle_outlines(frames: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return polygons along the images of circles of radii (k,), px, shape (k, 32, 2)."""
    angles = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
    return project(frames, circle_points(angles, radii[:, None]))[:, :, 0]


def project(frames: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the images of points of the target's plane, px, shape (k, ..., 2).

    Points of shape (..., 2), of up to three axes, are the same for every frame, those of shape
    (k, m, n, 2) are others for each.
    """
    spread = (slice(None),) + (None,) * (points.ndim - 1 - (points.ndim > 3))
    x, y = points[..., 0], points[..., 1]
    rows = [[element[spread] for element in row.T] for row in frames.transpose(1, 0, 2)]
    across, down, scale = (row[0] * x + row[1] * y + row[2] for row in rows)
    images = np.empty((*across.shape, 2))
    np.divide(across, scale, out=images[..., 0])
    np.divide(down, scale, out=images[..., 1])
    return images


def displacement_basis(angles: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return how far each frame change moves edges at m angles and radii outwards, dot radii.

    The columns, shape (m, 7), are translation x, y; strain 1, cos 2a, sin 2a; projective x, y.
    """
    cosine, sine = np.cos(angles), np.sin(angles)
    strain = [radii, radii * np.cos(2 * angles), radii * np.sin(2 * angles)]
    projective = [-(radii**2) * cosine, -(radii**2) * sine]
    return np.stack([cosine, sine, *strain, *projective], axis=-1)


def outline_basis(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return how far each change of a frame moves points of outlines along their normals.

    The columns, shape (m, 8), are those of `changed`; points and normals have the shape (m, 2).
    """
    (x, y), (across, down) = points.T, normals.T
    outwards = -(x * across + y * down)
    linear = [across * x, across * y, down * x, down * y]
    return np.stack([across, down, *linear, outwards * x, outwards * y], axis=-1)


def changed(frames: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Return frames after small changes, (k, 8), scaled so that their last element is one.

    The plane is changed before it is projected, by the translation (c, f) in x and y, the linear
    part a, b, d, e and the projective part g, h, in this order:

        (x, y) -> (x, y) + (a x + b y + c, d x + e y + f) - (g x + h y) (x, y).
    """
    change = np.tile(np.eye(3), (len(frames), 1, 1))
    change[:, :2, 2] = changes[:, :2]
    change[:, :2, :2] += changes[:, 2:6].reshape(-1, 2, 2)
    change[:, 2, :2] = changes[:, 6:]
    product = frames @ change
    return product / product[:, 2:, 2:]


def moved(frames: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Return frames of circles after small changes, as `changed` does.

    Changes are those of `displacement_basis`, all seven or all but the projective ones.
    """
    return changed(frames, changes @ _OF_CIRCLES[: changes.shape[1]])


def translated(frames: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return frames, shape (k, 3, 3), in the pixels of an image that shows (0, 0) at (x, y)."""
    return np.array([[1.0, 0, x], [0, 1.0, y], [0, 0, 1.0]]) @ frames


def centred(frames: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return the frames of dots in the same shapes about other centres, shape (..., 2)."""
    moved = frames.copy()
    moved[..., :2, 2] = centres
    return moved


def scaled(frames: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Return the frames of dots of other radii about the same centres, factors (k,)."""
    changed = frames.copy()
    changed[:, :, :2] *= factor[:, None, None]
    return changed


def enlarged(frames: np.ndarray, level: int) -> np.ndarray:
    """Return frames in the pixels of the image that was halved `level` times to give theirs."""
    scale = 2.0**level
    larger = frames.copy()
    larger[:, :2] = scale * frames[:, :2] + (scale - 1) / 2 * frames[:, 2:]
    return larger


def reduced(points: np.ndarray, level: int) -> np.ndarray:
    """Return points in px of the image that is halved `level` times, or doubled if below 0."""
    return (points + 0.5) / 2.0**level - 0.5


def ellipse_axes(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the semi-axes of the dots, major and minor, and the direction of the major ones.

    They belong to the affine part of the frame at its centre: px, and rad in (-pi/2, pi/2] from
    +x towards +y.
    """
    return axes_of(shapes(frames))


def shapes(frames: np.ndarray) -> np.ndarray:
    """Return the shapes of dots: squares of the affine parts of their frames, (k, 2, 2), px^2."""
    affine = local_affine(frames)
    across, down = affine[:, :, 0], affine[:, :, 1]
    return np.asarray(across[:, :, None] * across[:, None] + down[:, :, None] * down[:, None])


def axes_of(square: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the axes of dots as `ellipse_axes` does, from their `shapes`."""
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
    """Return the derivatives of frames' maps at the centre, shape (..., 2, 2), px a radius."""
    return frames[..., :2, :2] - frames[..., :2, 2:] * frames[..., 2:, :2]


def determinants(maps: np.ndarray) -> np.ndarray:
    """Return the determinants of linear maps of the plane, shape (..., 2, 2)."""
    return np.asarray(maps[..., 0, 0] * maps[..., 1, 1] - maps[..., 0, 1] * maps[..., 1, 0])


def inverses(maps: np.ndarray) -> np.ndarray:
    """Return the inverses of linear maps of the plane, shape (..., 2, 2), all of some size."""
    scale, inverse = 1 / determinants(maps), np.empty_like(maps)
    inverse[..., 0, 0], inverse[..., 1, 1] = maps[..., 1, 1] * scale, maps[..., 0, 0] * scale
    inverse[..., 0, 1], inverse[..., 1, 0] = maps[..., 0, 1] * -scale, maps[..., 1, 0] * -scale
    return inverse


def centre_covariance(frames: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the covariances of the images of centres, (k, 2, 2), px^2, from those in the plane.

    Pixels and interpolation add their own.
    """
    affine = local_affine(frames)
    return affine @ covariance @ affine.transpose(0, 2, 1) + _SYSTEMATIC**2 * np.eye(2)


def nearest(frames: np.ndarray, others: np.ndarray, count: int) -> np.ndarray:
    """Return which other dots have their centres nearest to those of dots, shape (k, count)."""
    away = np.hypot(*(frames[:, :2, 2].T[..., None] - others[:, :2, 2].T[:, None]))
    return np.argsort(away, axis=1, kind='stable')[:, :count]


def shears(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return how dots differ from others in shape, not in size, (k, n), others (k, n, 3, 3).

    It is the logarithm of the ratio of the axes of what circles of the others become here.
    """
    across = np.linalg.solve(local_affine(others), local_affine(frames)[:, None])
    stretched = np.linalg.svd(across, compute_uv=False)
    return np.asarray(np.log(stretched[..., 0] / stretched[..., 1]))
