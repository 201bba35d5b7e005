"""Poses of photographs of a plane: two of them look alike where perspective is weak.

Collins and Bartoli (2014), Infinitesimal Plane-based Pose Estimation.
"""

from dataclasses import replace

import cv2
import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import NetworkState

FLAT = 0.02
"""Points are a plane where their spread across it is less than this share of that along it."""


def principal_axes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations (d,) of points (n, d) along principal axes, and the axes."""
    centred = points - points.mean(axis=0)
    _, values, axes = np.linalg.svd(centred, full_matrices=False)
    spread = np.zeros(points.shape[1])
    spread[: len(values)] = values / np.sqrt(len(points))
    return spread, axes


def is_flat(points: FloatArray) -> bool:
    """Return whether points (n, 3) lie about in a plane, and not on a line."""
    spread, _ = principal_axes(points)
    return bool(spread[2] < FLAT * spread[1] and spread[1] > FLAT * spread[0])


def planar_poses(points: FloatArray, xy: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return both poses (rotation, position) of points (n, 3) about in a plane, seen at `xy`.

    OpenCV may say success and return NaN, or a pose that leaves the points behind the camera:
    these are dropped. The homography before it is robust, so that a wrong ID does not spoil both.
    """
    _, axes = principal_axes(points)
    turn = axes if np.linalg.det(axes) > 0 else axes * np.array([[1], [1], [-1]])
    centre = points.mean(axis=0)
    flat = (points - centre) @ turn.T
    plane, inliers = cv2.findHomography(flat[:, :2], xy, cv2.LMEDS)
    if plane is None or inliers is None or inliers.sum() < 4:
        return []
    good = inliers.ravel().astype(bool)
    flat[:, 2] = 0
    _, turns, shifts, _ = cv2.solvePnPGeneric(
        flat[good], xy[good], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    poses = []
    for vector, shift in zip(turns, shifts, strict=True):
        rotation = cv2.Rodrigues(vector)[0]
        depth = flat[good] @ rotation[2] + shift[2]
        if np.isfinite(rotation).all() and np.isfinite(shift).all() and np.all(depth > 0):
            poses.append((rotation @ turn, centre - turn.T @ rotation.T @ shift.ravel()))
    return poses


def mirrored(start: NetworkState) -> NetworkState:
    """Return the network that looks the same where perspective is weak (Necker's reversal).

    Points are mirrored at their mean plane. Each camera sees them under the same first two axes,
    mirrored: a plane stays as it is, and all cameras get their other planar pose.
    """
    points = start.points[np.isfinite(start.points[:, 0])]
    _, axes = principal_axes(points)
    mirror = np.eye(3) - 2 * np.outer(axes[2], axes[2])
    centre = points.mean(axis=0)
    rotations = np.diag([1.0, 1.0, -1.0]) @ start.rotations @ mirror
    seen = np.einsum('kij,kj->ki', start.rotations, centre - start.positions)
    positions = centre - np.einsum('kji,kj->ki', rotations, seen)
    return replace(
        start,
        points=centre + (start.points - centre) @ mirror,
        rotations=rotations,
        positions=positions,
    )
