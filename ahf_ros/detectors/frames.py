"""Dots as affine frames: sampling an image in them, and fitting them to their edges."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

RAYS = 48
"""Directions in which the edge of a dot is measured."""

REACH = 3.0
"""Distance on either side over which an edge is looked for, px along the minor axis."""

MAXIMUM_SCATTER = 0.08
"""Largest RMS distance of the edge from the ellipse, in radii of the dot."""


@dataclass(frozen=True, slots=True)
class Dots:
    """The ellipses of n dots, each as the affine frame in which the dot is the unit circle.

    Attributes
    ----------
    centres : ndarray of float64, shape (n, 2)
        px.
    frames : ndarray of float64, shape (n, 2, 2)
        Maps vectors of the frame to px; of positive determinant, so that it never mirrors.
    covariances : ndarray of float64, shape (n, 2, 2)
        Of the centres, px^2.
    """

    centres: np.ndarray
    frames: np.ndarray
    covariances: np.ndarray

    def chosen(self, which: np.ndarray | slice) -> Dots:
        """Return the dots that a mask, an index array or a slice chooses."""
        return Dots(self.centres[which], self.frames[which], self.covariances[which])


def dots_from_ellipses(
    x: np.ndarray, y: np.ndarray, first: np.ndarray, second: np.ndarray, angle: np.ndarray
) -> Dots:
    """Return the frames of n ellipses, with unknown (zero) covariances.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Centres, px.
    first, second : ndarray, shape (n,)
        Semi-axes, px.
    angle : ndarray, shape (n,)
        Direction of the first axis, rad, from +x towards +y.
    """
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    frames = np.moveaxis(axes, -1, 0) * np.column_stack([first, second])[:, None, :]
    return Dots(np.column_stack([x, y]), frames, np.zeros_like(frames))


def semi_axes(dots: Dots) -> tuple[np.ndarray, np.ndarray]:
    """Return the semi-axes, px, shape (n, 2), major first, and the angles of the major ones.

    Angles are in rad in (-pi/2, pi/2], from +x towards +y.
    """
    axes, lengths, _ = np.linalg.svd(dots.frames)
    angles = np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    return lengths, np.pi / 2 - (np.pi / 2 - angles) % np.pi


def inside(dots: Dots, radius: float, shape: tuple[int, ...]) -> np.ndarray:
    """Return which dots have all of the circle of `radius`, in radii of the dot, in an image.

    Parameters
    ----------
    dots : Dots
        n of them.
    radius : float
        In radii of the dot.
    shape : tuple of int
        (height, width) of the image, px.
    """
    extents = radius * np.linalg.norm(dots.frames, axis=2)
    last = np.array([shape[1], shape[0]]) - 1
    return ((dots.centres >= extents) & (dots.centres + extents <= last)).all(axis=1)


def sampled(image: np.ndarray, dots: Dots, radii: np.ndarray, directions: int) -> np.ndarray:
    """Return gray values on concentric circles of the dots' frames.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Of a type that OpenCV interpolates.
    dots : Dots
        n of them.
    radii : ndarray, shape (r,) or (n, r)
        Radii of the circles, in radii of the dot.
    directions : int
        Number of samples on a circle, counter-clockwise as seen in the image.

    Returns
    -------
    ndarray of float32, shape (n, r, directions)
        Interpolated bilinearly; the image is continued by its border.
    """
    radii = np.broadcast_to(radii, (len(dots.centres), np.shape(radii)[-1])).astype(np.float32)
    if not len(radii):
        return np.zeros((*radii.shape, directions), np.float32)
    offsets = (dots.frames @ _circle(directions)).astype(np.float32)
    points = radii[:, None, :, None] * offsets[:, :, None, :]
    points += dots.centres.astype(np.float32)[:, :, None, None]
    x, y = np.moveaxis(points.reshape(len(radii), 2, -1), 1, 0)
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return values.astype(np.float32).reshape(*radii.shape, directions)


def refined(image: np.ndarray, dots: Dots) -> tuple[Dots, np.ndarray]:
    """Return the dots fitted to their edges at sub-pixel accuracy, and which of them fit.

    The radial distances of the edge from the unit circle are fitted, by least squares, with the
    first harmonics round the circle: a scale, a shift and a change of the axes. Their residuals
    give the covariance. A dot fits if three quarters of its edge are there and lie on the ellipse.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values.
    dots : Dots
        n of them, known to about 2 px.

    Returns
    -------
    dots : Dots
        n of them.
    fits : ndarray of bool, shape (n,)
    """
    smallest = np.linalg.svd(dots.frames, compute_uv=False)[:, 1]
    reach = np.minimum(REACH / smallest, 0.45)
    distances, usable = _edges(image, dots, reach)
    x, y = _circle(RAYS)
    design = np.array([np.ones(RAYS), x, y, x * x - y * y, 2 * x * y])
    inverse = np.linalg.inv(np.einsum('ik,nk,jk->nij', design, usable, design) + 1e-9 * np.eye(5))
    right = np.einsum('ik,nk->ni', design, usable * distances)
    solution = np.einsum('nij,nj->ni', inverse, right)
    residuals = usable * (distances - solution @ design)
    variance = (residuals**2).sum(axis=1) / np.maximum(usable.sum(axis=1) - 5, 1)

    scale, _, _, stretch, shear = solution.T
    change = np.array([[1 + scale + stretch, shear], [shear, 1 + scale - stretch]])
    shift = np.einsum('nij,nj->ni', dots.frames, solution[:, 1:3])
    covariances = dots.frames @ inverse[:, 1:3, 1:3] @ np.swapaxes(dots.frames, 1, 2)
    moved = Dots(
        dots.centres + shift,
        dots.frames @ np.moveaxis(change, -1, 0),
        covariances * variance[:, None, None],
    )
    fits = (usable.mean(axis=1) > 0.75) & (variance < MAXIMUM_SCATTER**2)
    return moved, fits & (np.abs(solution).max(axis=1) < reach)


def _circle(directions: int) -> np.ndarray:
    """Return unit vectors, shape (2, directions), from +x counter-clockwise as seen."""
    turn = 2 * np.pi * np.arange(directions) / directions
    return np.array([np.cos(turn), -np.sin(turn)])


def _edges(image: np.ndarray, dots: Dots, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances of the edge from the unit circle on each ray, and which are usable.

    The edge is where an ideal step between the gray values at both ends of the ray would enclose
    the same sum as the ray does. A ray of less than half the median contrast has none.
    """
    steps = np.linspace(-1, 1, 13)
    values = sampled(image, dots, 1 + reach[:, None] * steps, RAYS)
    outside = values[:, -2:].mean(axis=1)
    contrast = values[:, :2].mean(axis=1) - outside
    typical = np.median(contrast, axis=1, keepdims=True)
    usable = contrast * np.sign(typical) > 0.5 * np.abs(typical)
    share = (values - outside[:, None]) / np.where(usable, contrast, 1)[:, None]
    share = np.clip(share, 0, 1)
    return reach[:, None] * ((share[:, 1:] + share[:, :-1]).mean(axis=1) - 1), usable
