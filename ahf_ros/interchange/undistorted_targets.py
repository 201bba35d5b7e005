"""Targets as they would be in the image of a camera without distortion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ahf_ros.interchange.camera_info import Calibration, undistorted, undistorted_derivatives
from ahf_ros.target import Target


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
