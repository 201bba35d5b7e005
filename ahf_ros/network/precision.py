"""Covariances of what an adjustment estimates, and of the image points that it computes.

All of them come from the inverse of the reduced and bordered normal equations; none is conditioned
on anything else being known (Förstner & Wrobel, Photogrammetric Computer Vision, 2016, 4.2 and
15.3).
"""

from dataclasses import dataclass

import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.normals import Design, Layout, Reduced, bordered


@dataclass(frozen=True)
class Precision:
    """Covariances of points and free parameters (u, u), of poses (n, 6, 6), and between them."""

    rest: FloatArray
    poses: FloatArray
    crossed: FloatArray


def precision(reduced: Reduced, border: FloatArray) -> Precision:
    """Return the covariances in the datum of the border (u, h), for unit weights."""
    unknowns = len(reduced.matrix)
    inverse = np.linalg.inv(bordered(reduced, border)[0])[:unknowns, :unknowns]
    rest = reduced.scale[:, None] * (inverse + inverse.T) / 2 * reduced.scale
    held = border[:, (border != 0).sum(axis=0) == 1].any(axis=1)
    rest[held], rest[:, held] = 0.0, 0.0  # exactly: rounding would make variances below zero
    factor = np.linalg.inv(reduced.factor)
    transposed = factor.transpose(0, 2, 1)
    by_rest = -transposed @ reduced.half
    crossed = (by_rest.reshape(-1, unknowns) @ rest).reshape(by_rest.shape)
    poses = transposed @ factor + crossed @ by_rest.transpose(0, 2, 1)
    return Precision(rest, poses, crossed)


def of_computed(layout: Layout, design: Design, known: Precision) -> FloatArray:
    """Return the covariances (m, 2, 2) of computed image points, whitened as the design is."""
    point = 3 * layout.point[:, None] + np.arange(3)
    padded = np.pad(known.rest, (0, 1))  # parameters that are kept fixed have column -1
    crossed = np.pad(known.crossed, ((0, 0), (0, 0), (0, 1)))
    parameter = layout.columns[layout.camera]
    image, six = layout.photograph[:, None, None], np.arange(6)[:, None]
    pairs = (
        (design.by_pose, known.poses[layout.photograph], design.by_pose),
        (design.by_point, padded[point[:, :, None], point[:, None]], design.by_point),
        (design.by_pose, 2 * crossed[image, six, point[:, None]], design.by_point),
    )
    total = sum(
        (left @ covariance @ right.transpose(0, 2, 1) for left, covariance, right in pairs),
        start=np.zeros((len(layout.xy), 2, 2)),
    )
    if layout.free.any():
        by = design.by_calibration
        mixed = 2 * design.by_pose @ crossed[image, six, parameter[:, None]]
        mixed += 2 * design.by_point @ padded[point[:, :, None], parameter[:, None]]
        mixed += by @ padded[parameter[:, :, None], parameter[:, None]]
        total = total + mixed @ by.transpose(0, 2, 1)
    return (total + total.transpose(0, 2, 1)) / 2
