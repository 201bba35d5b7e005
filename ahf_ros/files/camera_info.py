"""Calibrations of cameras from messages, and points and targets without distortion of the lens."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import SquareMarker, Target

MODELS = {
    'plumb_bob': (4, 5),
    'rational_polynomial': (8, 12, 14),
    'equidistant': (4,),
    'fisheye': (4,),
    '': (),
}
"""Accepted distortion models with their numbers of coefficients; all of them accept none.

Their names are those of sensor_msgs/distortion_models.hpp. `fisheye` is what some drivers call
`equidistant`, the model of Kannala and Brandt (2006); the others are those of Brown and of OpenCV.
"""

_FISHEYE = ('equidistant', 'fisheye')
_STEPS = 20  # of Newton's method, which needs 3 to 6
_STEP = 1e-6  # of the derivatives of a distortion, in focal lengths
_ACCURACY = 1e-9  # of its inverse, in focal lengths
_FRACTIONS = np.linspace(0.1, 1, 10)  # of a point's distance from the axis
_MARGIN = 0.5  # distance of the points that the derivatives at a centre come from, px


@dataclass(frozen=True, slots=True)
class Calibration:
    """How a camera projects, and which part of its sensor an image shows.

    `frame` is the coordinate frame of the camera, `size` the width and height that its images
    have, px. An image begins at column and row `offset` of the sensor, and `binning` columns and
    rows of it make a pixel. `matrix` and `projection`, of shape (3, 3), are the camera matrices of
    the sensor and of the rectified image, and `rotation` leads from the frame of the camera to the
    one of the rectified image. `model` is one of `MODELS`, `distortion` has its coefficients.
    """

    frame: str
    size: tuple[float, float]
    offset: tuple[int, int]
    binning: tuple[int, int]
    matrix: np.ndarray
    projection: np.ndarray  # the camera matrix where `projects` is false
    projects: bool
    rotation: np.ndarray
    model: str
    distortion: np.ndarray

    def check(self, frame: str, width: int, height: int) -> None:
        """Raise a ValueError if the frame or the size of an image is not that of this camera."""
        if frame != self.frame:
            raise ValueError(
                f'frame_id of camera_info is {self.frame!r}, accepted is that of the image, '
                f'{frame!r}'
            )
        # Drivers round the size of a binned image down or up.
        if any(abs(own - size) >= 1 for own, size in zip(self.size, (width, height), strict=True)):
            own = ' x '.join(f'{size:g}' for size in self.size)
            raise ValueError(
                f'camera_info is of an image of {own} px, accepted is the size of the image, '
                f'{width} x {height} px'
            )


def calibration(message: Any) -> Calibration:
    """Return the calibration that a sensor_msgs/CameraInfo holds.

    A ValueError is raised if the camera is not calibrated, or the model of distortion is none that
    is accepted.
    """
    matrix = np.array(message.k, float).reshape(3, 3)
    if not (np.isfinite(matrix).all() and matrix[0, 0] > 0 and matrix[1, 1] > 0):
        raise ValueError(
            f'k of camera_info has the focal lengths {matrix[0, 0]:g} and {matrix[1, 1]:g}, '
            'accepted are numbers above 0: a camera that is calibrated'
        )
    model, distortion = message.distortion_model, np.array(message.d, float)
    if not distortion.any():
        model, distortion = '', distortion[:0]
    if model not in MODELS:
        names = ', '.join(filter(None, MODELS))
        raise ValueError(f'distortion_model is {model!r}, accepted is one of {names}')
    if len(distortion) not in (0, *MODELS[model]) or not np.isfinite(distortion).all():
        numbers = ' or '.join(map(str, (0, *MODELS[model])))
        raise ValueError(
            f'd of camera_info is {distortion.tolist()}, accepted are {numbers} finite numbers '
            f'with the distortion_model {model!r}'
        )
    rotation = np.array(message.r, float).reshape(3, 3)
    projection = np.array(message.p, float).reshape(3, 4)[:, :3]
    roi = message.roi
    binning = max(1, message.binning_x), max(1, message.binning_y)
    sides = roi.width or message.width, roi.height or message.height
    return Calibration(
        frame=message.header.frame_id,
        size=(sides[0] / binning[0], sides[1] / binning[1]),
        offset=(roi.x_offset, roi.y_offset),
        binning=binning,
        matrix=matrix,
        projection=projection if projection[0, 0] > 0 else matrix,
        projects=bool(projection[0, 0] > 0),
        rotation=rotation if rotation.any() else np.eye(3),
        model=model,
        distortion=distortion,
    )


def undistorted(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return where points of an image, of shape (k, 2), are in the rectified image, px.

    This is the image that `image_proc` calls `image_rect`: without distortion, with the rotation
    `r` and the projection `p` of the message, and with the same region of interest and binning.
    Binned pixels are taken to be means, so that the centre of the first one is the centre of all
    pixels in it. A point is NaN if nothing that the camera sees is distorted to there, or if the
    rectified image does not show it.

    The inverse of the distortion is exact: `cv2.undistortPoints` stops after five iterations,
    0.05 px away at the edge of an ordinary image.
    """
    binning, offset = np.array(camera.binning), np.array(camera.offset)
    there = _rays(camera, points) @ camera.projection.T
    return (there[:, :2] / there[:, 2:] - offset + 0.5) / binning - 0.5


def places(camera: Calibration, points: np.ndarray, rectified: bool = False) -> np.ndarray:
    """Return where the rays of image points, of shape (k, 2), meet the plane z = 1.

    That plane is before the rectified camera, also for points of an image as received: `r` of the
    message is the identity but for stereo, and whoever reads its frame takes it for that camera.
    With `rectified`, points are those of a rectified image. They are NaN as in `undistorted`.
    """
    if not rectified:
        rays = _rays(camera, points)
    else:
        if not camera.projects or not np.isfinite(camera.projection).all():
            raise ValueError(
                'p of camera_info has zeros or no numbers, accepted for rectified images is a '
                'projection with focal lengths above 0'
            )
        ahead = np.column_stack((_on_sensor(camera, points), np.ones(len(points))))
        rays = np.linalg.solve(camera.projection, ahead.T).T
    return rays[:, :2] / rays[:, 2:]


def places_with_covariances(
    camera: Calibration, points: np.ndarray, covariances: np.ndarray, rectified: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return `places` of points (k, 2) in px, and their covariances of those in px², (k, 2, 2)."""
    derivatives = _derivatives(lambda of, xy: places(of, xy, rectified), camera, points, _MARGIN)
    moved = derivatives @ covariances @ derivatives.transpose(0, 2, 1)
    return places(camera, points, rectified), moved


def _on_sensor(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return points of an image, (k, 2), in pixels of the sensor."""
    return (points + 0.5) * np.array(camera.binning) - 0.5 + np.array(camera.offset)


def _rays(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return directions (k, 3) of points in the frame of the rectified camera, or NaN."""
    focal, centre = camera.matrix[[0, 1], [0, 1]], camera.matrix[:2, 2]
    seen = (_on_sensor(camera, points) - centre) / focal
    seen[:, 0] -= camera.matrix[0, 1] / focal[0] * seen[:, 1]
    ideal = _inverse(camera, seen)
    rays = np.column_stack((ideal, np.ones(len(ideal)))) @ camera.rotation.T
    rays[~(rays[:, 2] > 0)] = math.nan
    return rays


def _distorted(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return where the lens shows points, both in focal lengths from the axis."""
    if not camera.distortion.any() or not len(points):
        return points
    identity = np.eye(3)
    if camera.model in _FISHEYE:
        return cv2.fisheye.distortPoints(points[:, None], identity, camera.distortion)[:, 0]
    ahead = np.column_stack((points, np.ones(len(points))))
    zero = np.zeros(3)
    return cv2.projectPoints(ahead, zero, zero, identity, camera.distortion)[0][:, 0]


def _inverse(camera: Calibration, seen: np.ndarray) -> np.ndarray:
    """Return the points that the lens shows at `seen`, by Newton's method."""
    if not camera.distortion.any():
        return seen
    ideal = seen.copy()
    if camera.model in _FISHEYE:
        angle = np.hypot(*seen.T)
        ideal *= (np.tan(np.minimum(angle, 1.5)) / np.maximum(angle, _STEP))[:, None]
    with np.errstate(all='ignore'):
        for _ in range(_STEPS):
            (a, b), (c, d) = _slopes(camera, ideal)
            x, y = (_distorted(camera, ideal) - seen).T
            if not (np.abs((x, y)) > _ACCURACY / 10).any():
                break
            ideal = (
                ideal - np.column_stack((d * x - b * y, a * y - c * x)) / (a * d - b * c)[:, None]
            )
        error = np.abs(_distorted(camera, ideal) - seen).max(axis=1, initial=0)
        # From the axis outwards up to the first fold, a model describes a lens.
        good = error < _ACCURACY
        for fraction in _FRACTIONS:
            (a, b), (c, d) = _slopes(camera, fraction * ideal)
            good &= a * d > b * c
    return np.where(good[:, None], ideal, math.nan)


def _slopes(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return the derivatives of `_distorted` at points, shape (2, 2, k): of x, y by x, y."""
    return np.moveaxis(_derivatives(_distorted, camera, points, _STEP), 0, -1)


def _derivatives(
    function: Callable[[Calibration, np.ndarray], np.ndarray],
    camera: Calibration,
    points: np.ndarray,
    step: float,
) -> np.ndarray:
    """Return the derivatives of a function at points, shape (k, 2, 2): of x, y by x, y."""
    steps = step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    around = function(camera, (points[:, None] + steps).reshape(-1, 2)).reshape(-1, 4, 2)
    right, left, below, above = np.moveaxis(around, 1, 0)
    return np.stack((right - left, below - above), axis=2) / (2 * step)


def undistorted_targets(camera: Calibration, targets: Sequence[Target]) -> tuple[Target, ...]:
    """Return targets with centres, covariances and ellipses in the rectified image.

    These are NaN where the calibration does not reach, see `undistorted`.
    """
    centres = np.array([(target.x, target.y) for target in targets]).reshape(-1, 2)
    moved = undistorted(camera, centres).tolist()
    derivatives = _derivatives(undistorted, camera, centres, _MARGIN)
    return tuple(
        _with_corners(camera, target, of)
        for target, of in zip(targets, map(_moved, targets, moved, derivatives), strict=True)
    )


def _with_corners(camera: Calibration, target: Target, moved: Target) -> Target:
    """Return a moved target with the corners that the target has, if it is a square marker."""
    if not isinstance(target, SquareMarker):
        return moved
    corners = tuple(map(tuple, undistorted(camera, np.array(target.corners)).tolist()))
    names = 'x', 'y', 'semi_major', 'semi_minor', 'angle', 'covariance'
    return replace(target, **{name: getattr(moved, name) for name in names}, corners=corners)


def _moved(target: Target, centre: list[float], derivatives: np.ndarray) -> Target:
    x, y = centre
    if not (np.isfinite(centre).all() and np.isfinite(derivatives).all()):
        x = y = major = minor = angle = math.nan
        covariance = np.full((2, 2), math.nan)
    else:
        covariance = np.array(target.covariance).reshape(2, 2)
        covariance = derivatives @ covariance @ derivatives.T
        # A circle of radius 1, stretched and turned, is the ellipse.
        cosine, sine = math.cos(target.angle), math.sin(target.angle)
        axes = np.array([[cosine, -sine], [sine, cosine]]) * (target.semi_major, target.semi_minor)
        turned, (major, minor), _ = np.linalg.svd(derivatives @ axes)
        angle = math.atan(turned[1, 0] / turned[0, 0]) if turned[0, 0] else math.pi / 2
    xx, xy, yx, yy = covariance.ravel().tolist()
    return Target(
        id=target.id,
        code=target.code,
        x=x,
        y=y,
        semi_major=float(major),
        semi_minor=float(minor),
        angle=angle,
        confidence=target.confidence,
        covariance=(xx, xy, yx, yy),
        family=target.family,
        polarity=target.polarity,
    )
