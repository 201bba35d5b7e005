"""Calibrations of cameras from messages, and points and targets without distortion of the lens."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ahf_ros.target import Target

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

    Attributes
    ----------
    frame : str
        Coordinate frame of the camera.
    size : tuple of 2 float
        Width and height that its images have, px.
    offset : tuple of 2 int
        Column and row of the sensor where an image begins, px.
    binning : tuple of 2 int
        Columns and rows of the sensor that make a pixel.
    matrix, projection : ndarray, shape (3, 3)
        Camera matrices of the sensor and of the rectified image.
    rotation : ndarray, shape (3, 3)
        From the frame of the camera to the frame of the rectified image.
    model : str
        One of `MODELS`.
    distortion : ndarray
        Its coefficients.
    """

    frame: str
    size: tuple[float, float]
    offset: tuple[int, int]
    binning: tuple[int, int]
    matrix: np.ndarray
    projection: np.ndarray
    rotation: np.ndarray
    model: str
    distortion: np.ndarray

    def check(self, frame: str, width: int, height: int) -> None:
        """Refuse an image that is not of this camera.

        Raises
        ------
        ValueError
            If frame or size differ.
        """
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
    """Return the calibration that a message holds.

    Parameters
    ----------
    message : sensor_msgs/CameraInfo

    Raises
    ------
    ValueError
        If the camera is not calibrated or the distortion is of a model that is not accepted.

    Examples
    --------
    >>> from types import SimpleNamespace as Message
    >>> info = Message(
    ...     header=Message(frame_id='camera'), width=640, height=480, binning_x=0, binning_y=0,
    ...     roi=Message(x_offset=0, y_offset=0, width=0, height=0),
    ...     k=[600, 0, 320, 0, 600, 240, 0, 0, 1], r=9 * [0], p=12 * [0],
    ...     distortion_model='plumb_bob', d=[-0.3, 0.1, 0, 0, 0])
    >>> undistorted(calibration(info), np.array([[0.0, 0.0], [320.0, 240.0]])).round(3)
    array([[-54.521, -40.891],
           [320.   , 240.   ]])
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
        rotation=rotation if rotation.any() else np.eye(3),
        model=model,
        distortion=distortion,
    )


def undistorted(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return where points of an image are in the rectified image.

    The inverse of the distortion is exact: `cv2.undistortPoints` stops after five iterations,
    0.05 px away at the edge of an ordinary image.

    This is the image that `image_proc` calls `image_rect`: without distortion,
    with the rotation `r` and the projection `p` of the message. Binned pixels are taken to be
    means, so that the centre of the first one is the centre of all pixels in it.

    Parameters
    ----------
    camera : Calibration
    points : ndarray, shape (k, 2)
        x, y in the image as received, px.

    Returns
    -------
    ndarray, shape (k, 2)
        x, y in an image with the same region of interest and binning, px; NaN if nothing that the
        camera sees is distorted to there, or if the rectified image does not show it.
    """
    sensor = _on_sensor(camera, points)
    focal, centre = camera.matrix[[0, 1], [0, 1]], camera.matrix[:2, 2]
    seen = (sensor - centre) / focal
    seen[:, 0] -= camera.matrix[0, 1] / focal[0] * seen[:, 1]
    ideal = _inverse(camera, seen)
    rays = np.column_stack((ideal, np.ones(len(ideal)))) @ camera.rotation.T
    rays[~(rays[:, 2] > 0)] = math.nan
    there = rays @ camera.projection.T
    return _on_sensor(camera, there[:, :2] / there[:, 2:], inverse=True)


def undistorted_derivatives(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return the derivatives of `undistorted` at points, shape (k, 2, 2): of x, y by x, y."""
    steps = _MARGIN * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    around = (points[:, None] + steps).reshape(-1, 2)
    right, left, below, above = np.moveaxis(undistorted(camera, around).reshape(-1, 4, 2), 1, 0)
    return np.stack((right - left, below - above), axis=2) / (2 * _MARGIN)


def _on_sensor(camera: Calibration, points: np.ndarray, inverse: bool = False) -> np.ndarray:
    """Return points of the image as points of the sensor, or the inverse."""
    binning, offset = np.array(camera.binning), np.array(camera.offset)
    if inverse:
        return (points - offset + 0.5) / binning - 0.5
    return (points + 0.5) * binning - 0.5 + offset


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
            (a, b), (c, d) = np.moveaxis(_slopes(camera, ideal), 0, -1)
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
            (a, b), (c, d) = np.moveaxis(_slopes(camera, fraction * ideal), 0, -1)
            good &= a * d > b * c
    return np.where(good[:, None], ideal, math.nan)


def _slopes(camera: Calibration, points: np.ndarray) -> np.ndarray:
    """Return the derivatives of `_distorted` at points, shape (k, 2, 2): of x, y by x, y."""
    steps = _STEP * np.eye(2)
    columns = [
        (_distorted(camera, points + step) - _distorted(camera, points - step)) / (2 * _STEP)
        for step in steps
    ]
    return np.stack(columns, axis=2)


def undistorted_targets(camera: Calibration, targets: Sequence[Target]) -> tuple[Target, ...]:
    """Return targets with centres, covariances and ellipses in the rectified image.

    Parameters
    ----------
    camera : Calibration
        Calibration of the camera of the image.
    targets : sequence of Target
        Targets in the image as received.

    Returns
    -------
    tuple of Target
        In the same order; x, y, covariance and ellipse are NaN where the calibration does not
        reach, see `undistorted`.

    Examples
    --------
    >>> import numpy as np
    >>> from ahf_ros import Target
    >>> half = np.diag([0.5, 0.5, 1.0])
    >>> camera = Calibration(
    ...     'camera', (640, 480), (0, 0), (1, 1), np.eye(3), half, np.eye(3), '', np.empty(0))
    >>> target = Target(
    ...     id=8, code=31, x=100, y=60, semi_major=8, semi_minor=6, covariance=(0.04, 0, 0, 0.04))
    >>> moved, = undistorted_targets(camera, [target])
    >>> moved.x, moved.y, round(moved.covariance[0], 3), round(moved.semi_major, 3)
    (50.0, 30.0, 0.01, 4.0)
    """
    centres = np.array([(target.x, target.y) for target in targets]).reshape(-1, 2)
    moved = undistorted(camera, centres)
    return tuple(
        _moved(target, centre, derivatives)
        for target, centre, derivatives in zip(
            targets, moved.tolist(), undistorted_derivatives(camera, centres), strict=True
        )
    )


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
    )
