"""Homographies of small flat objects, fitted to the images of their points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    count = len(images)
    scaled = np.broadcast_to(points / reach, images.shape)
    if weights.ndim == 2:
        weights = weights[..., None, None] * np.eye(2)
    total = np.maximum(np.trace(weights, axis1=2, axis2=3).sum(axis=1), 1e-30)
    share = np.trace(weights, axis1=2, axis2=3) / total[:, None]
    middle = (share[..., None] * images).sum(axis=1)
    size = np.sqrt((share[..., None] * (images - middle[:, None]) ** 2).sum(axis=(1, 2)))
    size = np.maximum(size, 1e-6)[:, None]
    target = (images - middle[:, None]) / size[..., None]
    weights = weights * size[..., None, None] ** 2
    prior = np.diag([_WEAK] * 6 + [_PERSPECTIVE**-2] * 2)
    homogeneous = np.concatenate([scaled, np.ones((*scaled.shape[:2], 1))], axis=2)
    depth = np.ones(images.shape[:2])
    for _ in range(_ROUNDS):
        design = np.zeros((count, scaled.shape[1], 2, 8))
        design[:, :, 0, :3] = design[:, :, 1, 3:6] = homogeneous
        design[..., 6:] = -target[..., None] * scaled[..., None, :]
        design /= depth[..., None, None]
        weighted = (weights @ design).reshape(count, 2 * scaled.shape[1], 8)
        normal = weighted.transpose(0, 2, 1) @ design.reshape(weighted.shape) + prior
        right = (weighted * (target / depth[..., None]).reshape(*weighted.shape[:2], 1)).sum(
            axis=1
        )
        solution = np.linalg.solve(normal, right[..., None])[..., 0]
        depth = 1 + (scaled * solution[:, None, 6:]).sum(axis=2)
        depth = np.maximum(depth, _MINIMUM_DEPTH)
    elements = np.concatenate([solution, np.ones((count, 1))], axis=1).reshape(-1, 3, 3)
    elements[:, :, :2] /= reach
    back = np.zeros((count, 3, 3))
    back[:, 0, 0] = back[:, 1, 1] = size[:, 0]
    back[:, :2, 2], back[:, 2, 2] = middle, 1.0
    of_centre = np.linalg.inv(normal)[:, [[2], [5]], [2, 5]]
    return HomographyFit(back @ elements, of_centre * size[..., None] ** 2)


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
