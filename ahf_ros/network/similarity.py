"""Similarity transformations of points, of their covariance, and of a network."""

from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import NetworkState

FLAT = 1e-5
"""Extent across a line, relative to that along it, of points that are on the line."""


@dataclass(frozen=True)
class Similarity:
    """The movement x' = scale R x + translation, with R (3, 3) and translation (3,)."""

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0

    def moved(self, xyz: FloatArray) -> FloatArray:
        """Return points (n, 3) after the movement."""
        return self.scale * xyz @ self.rotation.T + self.translation

    def turned(self, covariance: FloatArray) -> FloatArray:
        """Return the covariance (3n, 3n) of points after the movement, which is without error."""
        count = len(covariance) // 3
        blocks = covariance.reshape(count, 3, count, 3)
        turned = np.einsum('ai,minj,bj->manb', self.rotation, blocks, self.rotation, optimize=True)
        return self.scale**2 * turned.reshape(covariance.shape)

    def in_frame(self, start: NetworkState) -> NetworkState:
        """Return the values of a network after the movement."""
        return replace(
            start,
            rotations=start.rotations @ self.rotation.T,
            positions=self.moved(start.positions),
            points=self.moved(start.points),
        )


def similarity_between(source: FloatArray, target: FloatArray, scale: bool = True) -> Similarity:
    """Return the movement of points (n, 3) to others with the least sum of squared distances.

    Umeyama, IEEE Trans. PAMI 1991, 13, 376.
    """
    centre, aim = source.mean(axis=0), target.mean(axis=0)
    left, values, right = np.linalg.svd((target - aim).T @ (source - centre))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left) * np.linalg.det(right))])
    rotation = (left * signs) @ right
    factor = float(values @ signs / ((source - centre) ** 2).sum()) if scale else 1.0
    return Similarity(rotation, aim - factor * rotation @ centre, factor)


def on_a_line(xyz: FloatArray, flat: float = FLAT) -> bool:
    """Return whether points (n, 3) are on a line, or in one place."""
    values = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return len(xyz) < 3 or bool(values[1] <= flat * values[0])


def in_principal_axes(start: NetworkState) -> NetworkState:
    """Return values in the frame of the points' centroid and principal axes, the longest first.

    The cameras are above the plane z = 0, and the target furthest along x has a positive x.
    """
    points = start.points[np.isfinite(start.points[:, 0])]
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre, full_matrices=False)[2]
    towards = np.nanmean(start.positions, axis=0) - centre
    along = (points - centre) @ axes[0]
    x = axes[0] * np.sign(along[np.abs(along).argmax()])
    z = axes[2] * np.sign(axes[2] @ towards or 1.0)
    rotation = np.stack([x, np.cross(z, x), z])
    return Similarity(rotation, -rotation @ centre).in_frame(start)
