"""Homographies of small flat objects, fitted to the images of their points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.frame import determinants, project

_ROUNDS = 3  # of linear solutions: each divides by the depth of the one before
_PERSPECTIVE = 0.08  # usual change of depth from the centre of an object to its edge, relative
_WEAK = 1e-9  # weight of a prior that only makes matrices invertible
_MINIMUM_DEPTH = 0.2  # as a fraction of the centre's depth


@dataclass(frozen=True, slots=True)
class HomographyFit:
    """Homographies of k objects."""

    homographies: np.ndarray  # (k, 3, 3), from the plane of the object to px, last element one
    covariance: np.ndarray  # (k, 2, 2), of the image of the centre of the object, px^2


def fit_homographies(
    points: np.ndarray, images: np.ndarray, weights: np.ndarray, reach: float
) -> HomographyFit:
    """Fit homographies to the images of points, with little perspective where they do not show it.

    Points in the plane of the object, shape (m, 2) or (k, m, 2), are about its centre; `reach` is
    its size from there, in their unit. Their images, shape (k, m, 2), are px. Weights are inverse
    variances, shape (k, m), or covariances, (k, m, 2, 2), 1/px^2; zero leaves a point out.
    """
    points = np.broadcast_to(points, images.shape)
    if weights.ndim == 2:
        weights = weights[..., None, None] * np.eye(2)
    given = points, images, weights, reach, _WEAK, _PERSPECTIVE**-2, _MINIMUM_DEPTH, _ROUNDS
    return HomographyFit(*kernels.fitted_homographies(*given))


def local_frames(homographies: np.ndarray, points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return frames of circles in the plane of objects, shape (k, m, 3, 3).

    Their centres, shape (m, 2) or (k, m, 2), and radii, (m,) or (k, m), are those in the plane.
    Frames are affine, with the image of the centre of the circle as their centre. Their second
    axis is turned round where the homography is a mirror image, as from a design with y upwards.
    """
    count = len(homographies)
    points = np.broadcast_to(points, (count, *points.shape[-2:]))
    radii = np.broadcast_to(radii, points.shape[:2])
    centres = project(homographies, points[:, :, None])[:, :, 0]
    depth = points @ homographies[:, 2, :2, None] + homographies[:, None, 2:, 2]
    frames = np.zeros((*points.shape[:2], 3, 3))
    slopes = homographies[:, None, :2, :2] - centres[..., None] * homographies[:, None, 2:, :2]
    frames[..., :2, :2] = slopes * (radii / depth[..., 0])[..., None, None]
    frames[..., 1] *= np.sign(determinants(frames))[..., None]
    frames[..., :2, 2], frames[..., 2, 2] = centres, 1.0
    return frames


def reference_frames(homographies: np.ndarray, radius: float) -> np.ndarray:
    """Return the frames of circles about the origin of the plane of objects, shape (k, 3, 3)."""
    return local_frames(homographies, np.zeros((1, 2)), np.array([radius]))[:, 0]
