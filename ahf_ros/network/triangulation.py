"""Points from the rays of oriented photographs.

Rays are given by normalised image coordinates, so nothing here knows a lens.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ahf_ros.network.network import FloatArray

SMALLEST_ANGLE = np.radians(5.0)
"""Rays that meet under less do not determine a point."""

MOST_PAIRS = 24
"""Pairs of rays a point is tried from: enough where a third of its rays are wrong."""


@dataclass(frozen=True)
class Intersection:
    """A point, the rays that agree on it, and the largest angle under which two of them meet."""

    xyz: FloatArray
    agrees: NDArray[np.bool_]
    angle: float


def directions(rotations: FloatArray, xy: FloatArray) -> FloatArray:
    """Return unit rays (n, 3) in the world at normalised `xy` (n, 2) of cameras (n, 3, 3)."""
    rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
    rays = np.einsum('nji,nj->ni', rotations, rays)
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def midpoints(
    first: FloatArray, second: FloatArray, position: FloatArray, other: FloatArray
) -> FloatArray:
    """Return the points (n, 3) next to both of two bundles of rays; NaN for parallel ones.

    `first` and `second` are unit directions (n, 3) from `position` and `other`, (3,) or (n, 3).
    """
    base = other - position
    cosine = np.sum(first * second, axis=1)
    along, across = np.sum(first * base, axis=1), np.sum(second * base, axis=1)
    determinant = 1 - cosine**2
    with np.errstate(divide='ignore', invalid='ignore'):
        near = (along - cosine * across) / determinant
        far = (cosine * along - across) / determinant
    points = (position + near[:, None] * first + other + far[:, None] * second) / 2
    return np.where((determinant > 1e-12)[:, None], points, np.nan)


def errors(
    points: FloatArray, rotations: FloatArray, positions: FloatArray, xy: FloatArray
) -> FloatArray:
    """Return distances in normalised image coordinates, infinite for points behind a camera.

    Any leading shapes that fit each other.
    """
    seen = np.einsum('...ij,...j->...i', rotations, points - positions)
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = np.linalg.norm(seen[..., :2] / seen[..., 2:] - xy, axis=-1)
    return np.where(seen[..., 2] > 0, distance, np.inf)


def largest_angle(rays: FloatArray) -> float:
    """Return the largest angle in rad between two of the unit directions (n, 3)."""
    if len(rays) < 2:
        return 0.0
    return float(np.arccos(np.clip(np.min(rays @ rays.T), -1, 1)))


def intersect(
    rotations: FloatArray, positions: FloatArray, xy: FloatArray, sigma: FloatArray
) -> Intersection | None:
    """Return the point on which most of n rays agree, or None.

    `sigma` (n,) are standard deviations of `xy`. The point of each pair of rays is compared with
    all of them; the least sum of bounded squares wins and is improved over the rays that agree.
    """
    rays = directions(rotations, xy)
    pairs = np.array(list(combinations(range(len(xy)), 2)))
    if not len(pairs):
        return None
    cosines = np.sum(rays[pairs[:, 0]] * rays[pairs[:, 1]], axis=1)
    wide = np.flatnonzero(cosines < np.cos(SMALLEST_ANGLE))
    chosen = pairs[
        wide[np.argsort(cosines[wide], kind='stable')[:: -(-len(wide) // MOST_PAIRS) or 1]]
    ]
    if not len(chosen):
        return None
    a, b = chosen.T
    found = midpoints(rays[a], rays[b], positions[a], positions[b])
    bound = 4.0
    ratio = errors(found[:, None], rotations, positions, xy) / sigma
    ratio[np.isnan(ratio)] = np.inf
    best = int(np.argmin(np.minimum(ratio, bound).sum(axis=1)))
    agrees = ratio[best] < bound
    point = found[best]
    for _ in range(2):
        if largest_angle(rays[agrees]) < SMALLEST_ANGLE:
            return None
        point = _improved(point, rotations[agrees], positions[agrees], xy[agrees], sigma[agrees])
        agrees = errors(point, rotations, positions, xy) < bound * sigma
    angle = largest_angle(rays[agrees])
    return Intersection(point, agrees, angle) if angle >= SMALLEST_ANGLE else None


def _improved(
    point: FloatArray,
    rotations: FloatArray,
    positions: FloatArray,
    xy: FloatArray,
    sigma: FloatArray,
) -> FloatArray:
    """Return the point after two Gauss-Newton steps on the weighted image errors."""
    for _ in range(2):
        seen = np.einsum('nij,nj->ni', rotations, point - positions)
        depth = seen[:, 2:]
        image = seen[:, :2] / depth
        jacobian = (rotations[:, :2] - image[:, :, None] * rotations[:, 2:3]) / depth[:, :, None]
        weighted = jacobian / sigma[:, None, None]
        rest = (xy - image) / sigma[:, None]
        step = np.linalg.lstsq(weighted.reshape(-1, 3), rest.ravel(), rcond=None)[0]
        point = point + step
    return point
