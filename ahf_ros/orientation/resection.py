"""The pose of a photograph of known points: P3P from many samples, then weighted least squares."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.planar import is_flat, planar_poses

FEWEST_POINTS = 5
"""Known points of a photograph that is oriented: one more than decide between the poses."""

SAMPLES = 60
"""Triples that are tried: of 60, one is free of wrong IDs with certainty while half are right."""

BOUND = 4.0
"""Standard deviations beyond which a point does not agree."""

ALIKE = 2.0
"""Chi-squares that differ by less do not decide between two poses."""

Pose = tuple[FloatArray, FloatArray]
"""Rotation (3, 3) from world to camera, and position (3,)."""


@dataclass(frozen=True)
class Resection:
    """A pose, the points that agree with it, its robust chi-square and its errors' scale."""

    rotation: FloatArray
    position: FloatArray
    agrees: NDArray[np.bool_]
    chi_square: float
    scale: float


def resections(points: FloatArray, xy: FloatArray, sigma: FloatArray) -> list[Resection]:
    """Return the poses from which `points` (n, 3) are seen at normalised `xy` (n, 2), best first.

    `sigma` (n,) are standard deviations of `xy`. A second pose follows only where another minimum
    was found. Chi-squares are in units of the best pose's scale, so that a lens that is not known
    yet does not decide.
    """
    if len(points) < FEWEST_POINTS:
        return []
    candidates = list(_sampled(points, xy))
    if is_flat(points):
        candidates += planar_poses(points, xy)
    if not candidates:
        return []
    rotations = np.array([rotation for rotation, _ in candidates])
    positions = np.array([position for _, position in candidates])
    ratio = _errors(rotations, positions, points, xy) / sigma
    enough = _half(len(points))
    scores = np.partition(ratio, enough - 1, axis=1)[:, enough - 1]
    found: list[Resection] = []
    for index in np.argsort(scores, kind='stable'):
        if scores[index] > 10 * scores.min() + 30 or len(found) == 3:
            break
        rotation, position = rotations[index], positions[index]
        if any(_alike(rotation, position, other, points) for other in found):
            continue
        pose = _weighted(rotation, position, points, xy, sigma)
        if pose is not None and not any(_alike(*pose, other, points) for other in found):
            found.append(_rated(*pose, points, xy, sigma))
    if not found:
        return []
    scale = max(min(one.scale for one in found), 1.0)
    found = [_rated(one.rotation, one.position, points, xy, sigma * scale) for one in found]
    return sorted(found, key=lambda one: one.chi_square)


def _half(number: int) -> int:
    """Return how many of the errors a least median looks at (Rousseeuw and Leroy 1987, p. 124)."""
    return min(number, number // 2 + 2)


def _sampled(points: FloatArray, xy: FloatArray) -> Iterable[Pose]:
    """Yield the poses of P3P of samples of three points, always the same samples."""
    random = np.random.default_rng(3)
    for _ in range(SAMPLES):
        three = random.choice(len(points), 3, replace=False)
        flags = cv2.SOLVEPNP_P3P
        count, turns, shifts = cv2.solveP3P(points[three], xy[three], np.eye(3), None, flags)
        for turn, shift in zip(turns[:count], shifts[:count], strict=True):
            rotation = cv2.Rodrigues(turn)[0]
            position = -rotation.T @ shift.ravel()
            if np.isfinite(rotation).all() and np.isfinite(position).all():
                yield rotation, position


def _errors(
    rotations: FloatArray, positions: FloatArray, points: FloatArray, xy: FloatArray
) -> FloatArray:
    """Return distances (poses, n) in normalised coordinates, infinite behind the camera."""
    seen = np.einsum('kij,knj->kni', rotations, points - positions[:, None])
    with np.errstate(divide='ignore', invalid='ignore'):
        distance = np.linalg.norm(seen[..., :2] / seen[..., 2:] - xy, axis=-1)
    return np.where(seen[..., 2] > 0, distance, np.inf)


def _alike(
    rotation: FloatArray, position: FloatArray, other: Resection, points: FloatArray
) -> bool:
    """Return whether two poses are one minimum: within 2 degrees and 2 % of the distance."""
    distance = np.linalg.norm(points.mean(axis=0) - other.position)
    moved = np.linalg.norm(position - other.position)
    turned = np.arccos(np.clip((np.trace(rotation @ other.rotation.T) - 1) / 2, -1, 1))
    return bool(moved < 0.02 * distance and turned < np.radians(2))


def _weighted(
    rotation: FloatArray,
    position: FloatArray,
    points: FloatArray,
    xy: FloatArray,
    sigma: FloatArray,
) -> Pose | None:
    """Return the pose after weighted Gauss-Newton steps with Cauchy's weights, None if it fails."""
    damping, before = 1e-6, np.inf
    best: Pose = rotation, position
    for _ in range(25):
        seen = (points - position) @ rotation.T
        if np.any(seen[:, 2] <= 0) and np.sum(seen[:, 2] > 0) < _half(len(points)):
            return None
        depth = np.where(seen[:, 2:] > 0, seen[:, 2:], np.nan)
        image = seen[:, :2] / depth
        rest = np.nan_to_num((xy - image) / sigma[:, None], nan=0.0)
        scale = max(1.0, 1.5 * float(np.median(np.linalg.norm(rest, axis=1))))
        squared = np.sum(rest**2, axis=1) / (3 * scale) ** 2
        weight = np.where(np.isnan(depth[:, 0]), 0, 1 / np.sqrt(1 + squared))
        ray = np.stack(
            [
                np.stack([1 / depth[:, 0], 0 * depth[:, 0], -image[:, 0] / depth[:, 0]], axis=1),
                np.stack([0 * depth[:, 0], 1 / depth[:, 0], -image[:, 1] / depth[:, 0]], axis=1),
            ],
            axis=1,
        )
        # A small turn w in the camera's frame moves X_camera by w x X_camera.
        turn = np.cross(seen[:, None], ray)
        jacobian = np.concatenate([turn, -ray @ rotation], axis=2) / sigma[:, None, None]
        jacobian = np.nan_to_num(jacobian * weight[:, None, None]).reshape(-1, 6)
        normal = jacobian.T @ jacobian
        right = jacobian.T @ (rest * weight[:, None]).ravel()
        cost = float(np.sum(np.log1p(squared)) * scale**2)
        normal[np.diag_indices(6)] *= 1 + damping
        try:
            step = np.linalg.solve(normal, right)
        except np.linalg.LinAlgError:
            return None
        best = rotation, position
        rotation = cv2.Rodrigues(step[:3])[0] @ rotation
        position = position + step[3:]
        if not np.isfinite(position).all():
            return None
        if abs(before - cost) <= 1e-7 * cost:
            break
        before = cost
    return (rotation, position) if np.isfinite(position).all() else best


def _rated(
    rotation: FloatArray,
    position: FloatArray,
    points: FloatArray,
    xy: FloatArray,
    sigma: FloatArray,
) -> Resection:
    """Return the pose with what agrees with it."""
    ratio = _errors(rotation[None], position[None], points, xy)[0] / sigma
    enough = _half(len(points))
    scale = float(np.partition(ratio, enough - 1)[enough - 1]) / np.sqrt(2 * np.log(2))
    bounded = np.minimum(ratio, BOUND * max(scale, 1.0))
    chi_square = float(np.sum(bounded**2))
    return Resection(rotation, position, ratio <= BOUND * max(scale, 1.0), chi_square, scale)
