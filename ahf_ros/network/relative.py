"""The relative orientation of two photographs from common IDs, in space and on a plane.

An essential matrix (Nister 2004, five points) and a homography are estimated side by side. Torr's
geometric robust information criterion (1998, GRIC) orders what comes out of them.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ahf_ros.network.camera import skew
from ahf_ros.network.network import FloatArray
from ahf_ros.network.triangulation import midpoints

FEWEST_POINTS = 6
"""Common points: five determine the relative orientation, one checks it."""

BOUND = 3.5
"""Standard deviations, from a least median of squares, beyond which a point does not agree."""


@dataclass(frozen=True)
class RelativeOrientation:
    """The pose of the second photograph in the frame of the first, with a base of length one.

    `criterion` is GRIC, the smaller the better; `angle` the median angle in rad of the rays,
    `scale` the robust standard deviation of the errors, normalised.
    """

    rotation: FloatArray
    position: FloatArray
    agrees: NDArray[np.bool_]
    criterion: float
    angle: float
    scale: float


def relative_orientations(
    first: FloatArray, second: FloatArray, sigma: float
) -> list[RelativeOrientation]:
    """Return the relative orientations that fit common points (n, 2), best first.

    Coordinates are normalised, `sigma` is their standard deviation. A homography has up to two
    decompositions with all points before both cameras; none is left out here, because two views
    of a plane do not tell them apart.
    """
    if len(first) < FEWEST_POINTS:
        return []
    spatial, scale = _essential(first, second, sigma)
    plane, transfer = _homography(first, second)
    found = []
    for rotation, shift, residuals in spatial:
        found.append(_rated(rotation, shift, first, second, residuals, scale, 3, 5))
    for rotation, shift in plane:
        found.append(_rated(rotation, shift, first, second, transfer, scale, 2, 8))
    return sorted(
        (one for one in found if one is not None and one.agrees.sum() >= FEWEST_POINTS),
        key=lambda one: one.criterion,
    )


def sampson_errors(essential: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return distances (n,) from the epipolar constraint (Hartley and Zisserman, 11.4)."""
    a = np.column_stack([first, np.ones(len(first))])
    b = np.column_stack([second, np.ones(len(second))])
    line, back = a @ essential.T, b @ essential
    slope = np.sum(line[:, :2] ** 2, axis=1) + np.sum(back[:, :2] ** 2, axis=1)
    return np.sum(b * line, axis=1) / np.sqrt(np.maximum(slope, 1e-300))


def _least_median_scale(residuals: FloatArray, parameters: int, floor: float) -> float:
    """Return the standard deviation from the median of residuals (Rousseeuw and Leroy 1987)."""
    number = len(residuals)
    order = min(number, (number + parameters + 1) // 2) - 1
    share = (order + 1 - parameters) / max(number - parameters, 1)
    # The residuals that a model was fitted to are small: the median is that of the others.
    quantile = {True: 0.6745, False: 1.15}[share < 0.6]
    return max(float(np.partition(np.abs(residuals), order)[order]) / quantile, floor)


def _essential(
    first: FloatArray, second: FloatArray, sigma: float
) -> tuple[list[tuple[FloatArray, FloatArray, FloatArray]], float]:
    """Return (rotation, shift, errors) of essential matrices, and the scale of the errors."""
    matrix: Any = cv2.findEssentialMat(first, second, np.eye(3), cv2.LMEDS, 0.9)[0]
    found, scales = [], []
    for essential in () if matrix is None else np.reshape(matrix, (-1, 3, 3)):
        pose = _in_front(essential, first, second, sigma)
        if pose is None:
            continue
        rotation, shift, residuals = _improved(*pose, first, second, sigma)
        found.append((rotation, shift, residuals))
        scales.append(_least_median_scale(residuals, 5, sigma))
    return found, min(scales, default=sigma)


def _in_front(
    essential: FloatArray, first: FloatArray, second: FloatArray, sigma: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the pose of an essential matrix with most points before both cameras."""
    if not np.isfinite(essential).all():
        return None
    one, other, shift = cv2.decomposeEssentialMat(essential)
    residuals = np.abs(sampson_errors(essential, first, second))
    good = residuals <= BOUND * _least_median_scale(residuals, 5, sigma)
    poses: list[tuple[FloatArray, FloatArray]] = [
        (np.asarray(turn, float), sign * np.asarray(shift, float).ravel())
        for turn in (one, other)
        for sign in (1, -1)
    ]
    counts = [np.sum(_before_both(*pose, first, second) & good) for pose in poses]
    return poses[int(np.argmax(counts))]


def _before_both(
    rotation: FloatArray, shift: FloatArray, first: FloatArray, second: FloatArray
) -> NDArray[np.bool_]:
    """Return which of the points (n,) lie before both cameras."""
    points, _ = _met(rotation, shift, first, second)
    with np.errstate(invalid='ignore'):
        return (points[:, 2] > 0) & (points @ rotation[2] + shift[2] > 0)


def _met(
    rotation: FloatArray, shift: FloatArray, first: FloatArray, second: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 3) in the first camera's frame and the angles (n,) of their rays."""
    rays = np.column_stack([first, np.ones(len(first))])
    others = np.column_stack([second, np.ones(len(second))]) @ rotation
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    points = midpoints(rays, others, np.zeros(3), -rotation.T @ shift)
    return points, np.arccos(np.clip(np.sum(rays * others, axis=1), -1, 1))


def _improved(
    rotation: FloatArray, shift: FloatArray, first: FloatArray, second: FloatArray, sigma: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return rotation, unit shift and Sampson errors after Gauss-Newton steps on those that agree.

    The five parameters are a small turn and two small movements across the shift; derivatives are
    differences, because the errors are cheap.
    """

    def moved(step: Any) -> tuple[FloatArray, FloatArray]:
        across = np.linalg.svd(shift[None])[2][1:]
        base = shift + step[3:] @ across
        return cv2.Rodrigues(step[:3])[0] @ rotation, base / np.linalg.norm(base)

    def error(step: FloatArray) -> FloatArray:
        turn, base = moved(step)
        return sampson_errors(skew(-base) @ turn, first, second)

    residuals = error(np.zeros(5))
    scale = _least_median_scale(residuals, 5, sigma)
    for _ in range(6):
        small = 1e-7
        jacobian = np.stack([(error(small * axis) - residuals) / small for axis in np.eye(5)], 1)
        weight = 1 / np.sqrt(1 + (residuals / (2 * scale)) ** 2)
        system, right = jacobian * weight[:, None], -residuals * weight
        step = np.linalg.lstsq(system, right, rcond=1e-9)[0]
        step *= min(1.0, 0.3 / max(float(np.linalg.norm(step)), 1e-300))
        rotation, shift = moved(step)
        residuals = error(np.zeros(5))
        now = _least_median_scale(residuals, 5, sigma)
        if np.linalg.norm(step) < 1e-6:
            break
        scale = min(scale, now)
    return rotation, shift, residuals


def _homography(
    first: FloatArray, second: FloatArray
) -> tuple[list[tuple[FloatArray, FloatArray]], FloatArray]:
    """Return the valid (rotation, unit shift) of a homography, and its transfer errors (n,)."""
    matrix, _ = cv2.findHomography(first, second, cv2.LMEDS)
    if matrix is None or not np.isfinite(matrix).all():
        return [], np.full(len(first), np.inf)
    image = np.column_stack([first, np.ones(len(first))]) @ matrix.T
    image = image / np.median(image[:, 2])
    with np.errstate(divide='ignore', invalid='ignore'):
        transfer = np.linalg.norm(image[:, :2] / image[:, 2:] - second, axis=1)
    transfer = np.nan_to_num(transfer, nan=np.inf) / np.sqrt(2)
    good = transfer <= BOUND * _least_median_scale(transfer, 8, 0)
    sign = np.sign(np.median(matrix[2] @ np.column_stack([first, np.ones(len(first))]).T))
    _, rotations, shifts, normals = cv2.decomposeHomographyMat(matrix * sign, np.eye(3))
    rays = np.column_stack([first, np.ones(len(first))])[good]
    found = []
    for rotation, shift, normal in zip(rotations, shifts, normals, strict=True):
        length = float(np.linalg.norm(shift))
        before = np.mean(rays @ normal.ravel() > 0) if np.isfinite(length) else 0
        if length > 1e-3 and before > 0.95 and abs(np.linalg.det(rotation) - 1) < 1e-3:
            found.append((np.asarray(rotation, float), np.asarray(shift, float).ravel() / length))
    return found, transfer


def _rated(
    rotation: FloatArray,
    shift: FloatArray,
    first: FloatArray,
    second: FloatArray,
    residuals: FloatArray,
    scale: float,
    dimension: int,
    parameters: int,
) -> RelativeOrientation:
    """Return the orientation with GRIC, sum min(e²/s², 2 (4 - d)) + n d ln 4 + k ln 4 n."""
    number = len(first)
    bounded = np.minimum((residuals / scale) ** 2, 2 * (4 - dimension))
    criterion = bounded.sum() + number * dimension * np.log(4) + parameters * np.log(4 * number)
    _, angles = _met(rotation, shift, first, second)
    own = _least_median_scale(residuals, parameters, scale)
    agrees = (np.abs(residuals) <= BOUND * own) & _before_both(rotation, shift, first, second)
    angle = float(np.median(angles[agrees])) if agrees.any() else 0.0
    return RelativeOrientation(rotation, -rotation.T @ shift, agrees, float(criterion), angle, own)
