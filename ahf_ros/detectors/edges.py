"""Frames of targets fitted to the edges of their circles, many targets at once."""

from __future__ import annotations

import numpy as np

from ahf_ros.frame import (
    circle_points,
    displacement_basis,
    ellipse_axes,
    local_affine,
    moved,
    project,
    sample,
)

RAYS = 48
"""Directions in which the edge of a circle is measured."""

REACH = 3.0
"""Distance on either side over which an edge is looked for, px along the minor axis."""

MAXIMUM_REACH = 0.45
"""The same at most, in dot radii: less than half a gap."""

STEPS = np.linspace(-1, 1, 13)
"""Where a ray is sampled, in reaches."""


def refined(
    image: np.ndarray, frames: np.ndarray, circles: tuple[float, ...] = (1.0,)
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frames fitted to edges at sub-pixel accuracy, by least squares.

    A ray across an edge that shows less than half the contrast of the dot is left out, so that the
    circles of a band count where it has the colour of the dot. The dot alone gives an affine
    change of the frame and leaves the perspective bias in the centre. With the circles of the band
    the change is projective, and one more unknown takes the shift of all edges towards one
    colour, which a camera's gamma causes and which would pass for perspective.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values.
    frames : ndarray of float64, shape (k, 3, 3)
        Known to about 2 px.
    circles : tuple of float
        Radii in dot radii: that of the dot alone, or those of dot, inner and outer edge of the
        band.

    Returns
    -------
    frames : ndarray of float64, shape (k, 3, 3)
    covariances : ndarray of float64, shape (k, 2, 2)
        Of the centres, from the scatter of the edges, px^2.
    scatter : ndarray of float64, shape (k,)
        RMS distance of the edges from the circles, in dot radii; infinite where less than three
        quarters of the dot's edge are found or the change is larger than the reach.
    """
    if not len(frames):
        return frames, np.zeros((0, 2, 2)), np.zeros(0)
    reach = np.minimum(REACH / ellipse_axes(frames)[1], MAXIMUM_REACH)
    distances, usable = _edges(image, frames, reach, circles)
    basis = _basis(frames, circles)
    weighted = (basis * usable[..., None]).transpose(0, 2, 1)
    inverse = np.linalg.inv(weighted @ basis + 1e-9 * np.eye(basis.shape[2]))
    changes = inverse @ weighted @ distances[..., None]
    residuals = usable * (distances - (basis @ changes)[..., 0])
    degrees = np.maximum(usable.sum(axis=1) - basis.shape[2], 1)
    variance = (residuals**2).sum(axis=1) / degrees

    axes = local_affine(frames)
    covariances = axes @ inverse[:, :2, :2] @ axes.transpose(0, 2, 1) * variance[:, None, None]
    found = usable[:, :RAYS].mean(axis=1) > 0.75
    near = np.abs(changes[:, :5, 0]).max(axis=1) < reach
    scatter = np.where(found & near, np.sqrt(variance), np.inf)
    return moved(frames, changes[:, :7, 0]), covariances, scatter


def _edges(
    image: np.ndarray, frames: np.ndarray, reach: np.ndarray, circles: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of edges outwards from the circles, and which rays have one.

    The edge is where an ideal step between the gray values at both ends of the ray would enclose
    the same sum as the ray does. Both are of shape (k, circles x RAYS).
    """
    radii = np.array(circles)[:, None] + reach[:, None, None] * STEPS
    points = circle_points(_ray_angles(), radii)
    pixels = project(frames, points.reshape(len(frames), -1, STEPS.size, 2))
    values = sample(image, pixels).astype(np.float32)
    outside = values[..., -2:].mean(axis=2)
    contrast = values[..., :2].mean(axis=2) - outside
    typical = np.median(contrast[:, :RAYS], axis=1, keepdims=True)
    usable = contrast * _signs(circles) * np.sign(typical) > 0.5 * np.abs(typical)
    share = (values - outside[..., None]) / np.where(usable, contrast, 1)[..., None]
    share = np.clip(share, 0, 1)
    middles = (share[..., 1:] + share[..., :-1]).mean(axis=2)
    return reach[:, None] * (middles - 1), usable


def _basis(frames: np.ndarray, circles: tuple[float, ...]) -> np.ndarray:
    """Return what moves the edges of `_edges`, shape (k, circles x RAYS, 5 or 8)."""
    angles = np.tile(_ray_angles(), len(circles))
    basis = displacement_basis(angles, np.repeat(circles, RAYS))
    basis = np.broadcast_to(basis, (len(frames), *basis.shape))
    if len(circles) == 1:
        return basis[..., :5]
    # A pixel across the edge is this many dot radii along the ray.
    directions = circle_points(angles, np.ones(1))[:, 0]
    shift = np.linalg.norm(directions @ np.linalg.inv(local_affine(frames)), axis=2)
    return np.concatenate([basis, (_signs(circles) * shift)[..., None]], axis=2)


def _signs(circles: tuple[float, ...]) -> np.ndarray:
    """Return 1 where the colour of the dot is inside of an edge, -1 where it is outside."""
    return np.repeat((-1.0) ** np.arange(len(circles)), RAYS)


def _ray_angles() -> np.ndarray:
    return 2 * np.pi * np.arange(RAYS) / RAYS
