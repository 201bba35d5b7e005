"""The pose of a photograph of known points: P3P from many samples, then weighted least squares."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.network import FloatArray
from ahf_ros.network.planar import is_flat, planar_poses
from ahf_ros.network.triangulation import errors

FEWEST_POINTS = 4
"""Known points of a photograph that is oriented: three leave four poses, the fourth decides."""

SAMPLES = 60
"""Triples that are tried: of 60, one is free of wrong IDs with certainty while half are right."""

MOST_STARTS = 4
"""Poses of samples that are improved, the best that differ by more than 8 degrees."""

ROUNDS = 15

BOUND = 4.0
"""Standard deviations beyond which a point does not agree."""

EXTENT = 20.0
"""Standard deviations over which image points must spread: others say nothing of the distance."""

ALIKE = 2.0
"""Chi-squares that differ by less do not decide between two poses."""

Pose = tuple[FloatArray, FloatArray]
"""Rotation (3, 3) from world to camera, and position (3,)."""


@dataclass(frozen=True)
class Resection:
    """A pose, the points that agree with it, its robust chi-square, and its errors' scale.

    The scale is the robust standard deviation of the errors in units of the given ones.
    """

    rotation: FloatArray
    position: FloatArray
    agrees: NDArray[np.bool_]
    chi_square: float
    scale: float


def at_one_place(xy: FloatArray, sigma: FloatArray) -> bool:
    """Return whether image points (n, 2) are too near to each other to determine a pose."""
    return bool(np.linalg.norm(xy.std(axis=0)) < EXTENT * np.median(sigma))


def resections(points: FloatArray, xy: FloatArray, sigma: FloatArray) -> list[Resection]:
    """Return the poses from which `points` (n, 3) are seen at normalised `xy` (n, 2), best first.

    `sigma` (n,) are standard deviations of `xy`. A second pose follows only where another minimum
    was found. Chi-squares are in units of the best pose's scale, so that a lens that is not known
    yet does not decide.
    """
    if len(points) < FEWEST_POINTS or at_one_place(xy, sigma):
        return []
    planar = planar_poses(points, xy) if is_flat(points) else []
    candidates = [*_sampled(points, xy), *planar]
    if not candidates:
        return []
    rotations, positions = (np.array(part) for part in zip(*candidates, strict=True))
    ratio = errors(points, rotations[:, None], positions[:, None], xy) / sigma
    enough = _half(len(points))
    scores = np.partition(ratio, enough - 1, axis=1)[:, enough - 1]
    ordered = (candidates[index] for index in np.argsort(scores, kind='stable'))
    poses = [*_distinct(ordered, points, 0.15, MOST_STARTS), *planar]
    poses = _distinct(_improved(poses, points, xy, sigma), points, 0.02, len(poses))
    found = [_rated(*pose, points, xy, sigma) for pose in poses]
    if not found:
        return []
    scale = max(min(one.scale for one in found), 1.0)
    rated = (_rated(one.rotation, one.position, points, xy, sigma * scale) for one in found)
    found = [replace(one, scale=one.scale * scale) for one in rated]
    return sorted(found, key=lambda one: one.chi_square)


def _half(number: int) -> int:
    """Return how many of the errors a least median looks at (Rousseeuw and Leroy 1987, p. 124)."""
    return min(number, number // 2 + 2)


@cache
def _samples(number: int) -> NDArray[np.intp]:
    """Return samples of three of so many points, (SAMPLES, 3), always the same."""
    random = np.random.default_rng(3)
    return np.array([random.choice(number, 3, replace=False) for _ in range(SAMPLES)])


def _sampled(points: FloatArray, xy: FloatArray) -> list[Pose]:
    """Return the poses of P3P of samples of three points."""
    moved, flags = [], cv2.SOLVEPNP_P3P  # rotation vectors and shifts
    for three in _samples(len(points)):
        count, *found = cv2.solveP3P(points[three], xy[three], np.eye(3), None, flags)
        moved += [np.ravel(of) for of in zip(*found, strict=True)][:count]
    if not moved:
        return []
    turns, shifts = np.hsplit(np.array(moved), 2)
    rotations = rotation_matrices(turns)
    positions = -(shifts[:, None] @ rotations)[:, 0]
    finite = np.isfinite(rotations).all(axis=(1, 2)) & np.isfinite(positions).all(axis=1)
    return list(zip(rotations[finite], positions[finite], strict=True))


def _distinct(poses: Iterable[Pose], points: FloatArray, least: float, most: int) -> list[Pose]:
    """Return the first poses that differ by `least`, in rad or as a share of the distance."""
    kept: list[Pose] = []
    centre = points.mean(axis=0)
    for rotation, position in poses:
        if len(kept) == most:
            break
        distance = np.linalg.norm(centre - position)
        for other, place in kept:
            cosine = (np.sum(rotation * other) - 1) / 2
            near = np.linalg.norm(position - place) < least * distance
            if near and cosine > np.cos(least):
                break
        else:
            kept.append((rotation, position))
    return kept


def _improved(
    poses: Sequence[Pose], points: FloatArray, xy: FloatArray, sigma: FloatArray
) -> list[Pose]:
    """Return the poses after weighted Gauss-Newton steps with Cauchy's weights, all side by side.

    Poses that see fewer than half of the points before them are dropped.
    """
    rotations, positions = (np.array(part) for part in zip(*poses, strict=True))
    count, number = len(poses), len(points)
    before = np.full(count, np.inf)
    for _ in range(ROUNDS):
        seen = (points - positions[:, None]) @ rotations.transpose(0, 2, 1)
        front = seen[..., 2] > 0
        inverse = 1 / np.where(front, seen[..., 2], np.inf)
        image = seen[..., :2] * inverse[..., None]
        rest = np.where(front[..., None], (xy - image) / sigma[:, None], 0)
        squared = np.sum(rest**2, axis=2)
        scale = np.maximum(1, 1.5 * np.sqrt(np.median(squared, axis=1)))[:, None]
        relative = squared / (3 * scale) ** 2
        weight = front / np.sqrt(1 + relative)
        cost = np.sum(np.log1p(relative), axis=1) * scale[:, 0] ** 2
        if np.all(np.abs(before - cost) <= 1e-6 * cost):
            break
        before = cost
        # A small turn w in the camera's frame moves X_camera by w x X_camera.
        x, y = image[..., 0], image[..., 1]
        by_pose = np.zeros((count, number, 2, 6))
        by_pose[..., 0, :3] = np.stack([-x * y, 1 + x**2, -y], axis=-1)
        by_pose[..., 1, :3] = np.stack([-1 - y**2, x * y, x], axis=-1)
        across = image[..., None] * rotations[:, None, None, 2]
        by_pose[..., 3:] = (across - rotations[:, None, :2]) * inverse[..., None, None]
        by_pose *= (weight / sigma)[..., None, None]
        jacobian = by_pose.reshape(count, 2 * number, 6)
        transposed = jacobian.transpose(0, 2, 1)
        normal = transposed @ jacobian
        diagonal = np.arange(6)
        normal[:, diagonal, diagonal] *= 1 + 1e-6
        normal[:, diagonal, diagonal] += np.finfo(float).tiny
        right = transposed @ (rest * weight[..., None]).reshape(count, 2 * number, 1)
        try:
            step = np.linalg.solve(normal, right)[..., 0]
        except np.linalg.LinAlgError:
            break
        step = np.where(np.isfinite(step), step, 0)
        rotations = rotation_matrices(step[:, :3]) @ rotations
        positions = positions + step[:, 3:]
    kept = front.sum(axis=1) >= _half(number)
    return list(zip(rotations[kept], positions[kept], strict=True))


def _rated(
    rotation: FloatArray,
    position: FloatArray,
    points: FloatArray,
    xy: FloatArray,
    sigma: FloatArray,
) -> Resection:
    """Return the pose with what agrees with it."""
    ratio = errors(points, rotation, position, xy) / sigma
    enough = _half(len(points))
    scale = float(np.partition(ratio, enough - 1)[enough - 1]) / np.sqrt(2 * np.log(2))
    bounded = np.minimum(ratio, BOUND * max(scale, 1.0))
    chi_square = float(np.sum(bounded**2))
    return Resection(rotation, position, ratio <= BOUND * max(scale, 1.0), chi_square, scale)
