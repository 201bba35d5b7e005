"""The camera: central projection, Brown's distortion [1]_, affinity and shear, and derivatives.

A calibration is a float array in the order of `PARAMETERS`. With (x, y) = (X, Y) / Z in the frame
of the camera (x right, y down, z forward), r² = x² + y² and OpenCV's k1, k2, k3, p1 and p2, the
distorted place is

    x'' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
    y'' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y

and the image point in px, with (0, 0) at the centre of the first pixel,

    u = cx + f ((1 + affinity) x'' + shear y''),   v = cy + f y''.

An equidistant fisheye lens [2]_, as OpenCV, ROS and Kalibr have it, has k4 in the place of p1 and
nothing in that of p2. With r = tan t,

    (x'', y'') = (x, y) t (1 + k1 t² + k2 t⁴ + k3 t⁶ + k4 t⁸) / r.

That is the forward model. Backward, as DBAT, PhotoModeler and Australis have it, the same terms
are a correction at the measured place (x_m, y_m): (x, y) = (x_m, y_m) + d(x_m, y_m).

References
----------
.. [1] Brown, Close-range camera calibration, Photogramm. Eng. 37 (8), 1971, 855-866.
.. [2] Kannala & Brandt, A generic camera model and calibration method for conventional,
   wide-angle, and fish-eye lenses, IEEE Trans. PAMI 28 (8), 2006, 1335-1340.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahf_ros.network.network import CameraView, FloatArray

PARAMETERS = ('f', 'cx', 'cy', 'k1', 'k2', 'k3', 'p1', 'p2', 'affinity', 'shear')

EQUIDISTANT = ('f', 'cx', 'cy', 'k1', 'k2', 'k3', 'k4', '', 'affinity', 'shear')
"""The same of an equidistant fisheye lens."""

Fisheye = NDArray[np.bool_] | bool
"""Whether lenses are equidistant fisheye ones: all, or one a point."""

_WIDEST = 1.55  # rad off the axis that an image shows
_ON_AXIS = 1e-8  # distance from the axis at which the limit is as good
_INVERSIONS = 30  # steps of Newton's method; four are enough for usual lenses
_INVERTED = 1e-12  # largest step of the last one, in focal lengths


class Linearised(NamedTuple):
    """Image points (n, 2) and their derivatives by calibration, pose and point.

    They are (n, 2, 10), (n, 2, 6) and (n, 2, 3). A pose is changed by its position and by a
    rotation vector in the frame of the camera, R <- exp([r]x) R.
    """

    xy: FloatArray
    by_calibration: FloatArray
    by_pose: FloatArray
    by_point: FloatArray


def pinhole(focal_length: float, width: int, height: int) -> FloatArray:
    """Return the calibration of a camera without distortion whose principal point is central."""
    calibration = np.zeros(len(PARAMETERS))
    calibration[:3] = focal_length, (width - 1) / 2, (height - 1) / 2
    return calibration


def parameters_of(view: CameraView) -> tuple[str, ...]:
    """Return the names of the parameters of a camera; that of what it does not have is empty."""
    return EQUIDISTANT if view.equidistant else PARAMETERS


def known_calibration(view: CameraView) -> FloatArray:
    """Return what is given of a camera: no lens and a focal length of NaN where nothing is."""
    if view.calibration is not None:
        return view.calibration
    return pinhole(view.focal_length or np.nan, view.width, view.height)


def project(
    calibration: FloatArray,
    rotation: FloatArray,
    position: FloatArray,
    points: FloatArray,
    measured: FloatArray | None = None,
    equidistant: Fisheye = False,
) -> FloatArray:
    """Return the images (n, 2) in px of points (n, 3); NaN behind the camera.

    Calibration, rotation and position are one or one a point. With measured image points (n, 2),
    the distortion is the backward one at these places, which is that of no fisheye lens.
    """
    calibration = np.asarray(calibration, dtype=float)
    seen = _rotated(rotation, points - position)
    with np.errstate(divide='ignore', invalid='ignore'):
        ideal = seen[:, :2] / np.where(seen[:, 2:] > 0, seen[:, 2:], np.nan)
    if measured is None:
        return _imaged(calibration, ideal + _distortion(calibration, ideal, equidistant))
    correction = _distortion(calibration, measured_places(calibration, measured), False)
    return _imaged(calibration, ideal - correction)


def undistort(
    calibration: FloatArray, xy: FloatArray, backward: bool = False, equidistant: Fisheye = False
) -> FloatArray:
    """Return the places (n, 2) in the plane z = 1 whose images are xy in px, by Newton's method.

    A place that the distortion never reaches is NaN. Calibrations are one or one a point.
    """
    calibration = np.asarray(calibration, dtype=float)
    distorted = measured_places(calibration, xy)
    if backward:
        return distorted + _distortion(calibration, distorted, False)
    ideal = distorted.copy()
    if np.any(equidistant):
        fisheye = _undistorted_fisheye(calibration, distorted)
        ideal = np.where(np.reshape(equidistant, (-1, 1)), fisheye, distorted)
    step = np.zeros_like(ideal)
    with np.errstate(all='ignore'):
        for _ in range(_INVERSIONS):
            gap = distorted - ideal - _distortion(calibration, ideal, equidistant)
            slope = np.eye(2) + _distortion_by_place(calibration, ideal, equidistant)
            step = _solved(slope, gap)
            ideal += step
            if not (np.abs(step) > _INVERTED).any():
                break
        return np.where((np.abs(step) <= _INVERTED).all(axis=1, keepdims=True), ideal, np.nan)


def measured_places(calibration: FloatArray, xy: FloatArray) -> FloatArray:
    """Return image points (n, 2) in px as distorted places (n, 2) in the plane z = 1."""
    f, cx, cy, affinity, shear = np.asarray(calibration, dtype=float).T[[0, 1, 2, 8, 9]]
    y = (xy[:, 1] - cy) / f
    return np.stack([((xy[:, 0] - cx) / f - shear * y) / (1 + affinity), y], axis=-1)


def linearise(
    calibration: FloatArray,
    rotation: FloatArray,
    position: FloatArray,
    points: FloatArray,
    measured: FloatArray | None = None,
    equidistant: Fisheye = False,
) -> Linearised:
    """Return images of points with their analytic derivatives; arguments as in `project`.

    With measured image points (n, 2), the distortion is the backward one at these places.
    """
    calibration = np.broadcast_to(calibration, (len(points), len(PARAMETERS)))
    rotation = np.broadcast_to(rotation, (len(points), 3, 3))
    seen = _rotated(rotation, points - position)
    ideal = seen[:, :2] / seen[:, 2:]
    place, sign = (ideal, 1) if measured is None else (measured_places(calibration, measured), -1)
    distorted = ideal + sign * _distortion(calibration, place, equidistant)
    by_place = _distortion_by_place(calibration, place, equidistant)
    sensor = _sensor(calibration)

    by_calibration = np.zeros((len(points), 2, len(PARAMETERS)))
    by_calibration[:, :, 3:8] = sign * sensor @ distortion_by_coefficient(place, equidistant)
    outer = [0, 1, 2, 8, 9]
    by_calibration[:, :, outer] = _sensor_by_parameter(calibration, distorted)
    by_ideal = sensor
    if measured is None:
        by_ideal = sensor + sensor @ by_place
    else:  # the measured place moves against the sensor's parameters
        moved = np.linalg.solve(sensor, _sensor_by_parameter(calibration, place))
        by_calibration[:, :, outer] += sensor @ by_place @ moved

    perspective = np.zeros((len(points), 2, 3))
    perspective[:, 0, 0] = perspective[:, 1, 1] = 1
    perspective[:, :, 2] = -ideal
    by_seen = by_ideal @ (perspective / seen[:, 2, None, None])
    by_point = by_seen @ rotation
    by_rotation = by_seen @ skew(-seen)
    return Linearised(
        _imaged(calibration, distorted),
        by_calibration,
        np.concatenate([-by_point, by_rotation], axis=2),
        by_point,
    )


def skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices (..., 3, 3) whose products are cross products with vectors (..., 3)."""
    matrices = np.zeros((*vectors.shape, 3))
    matrices[..., [2, 0, 1], [1, 2, 0]] = vectors
    matrices[..., [1, 2, 0], [2, 0, 1]] = -vectors
    return matrices


def rotation_matrices(vectors: FloatArray) -> FloatArray:
    """Return the rotations (n, 3, 3) of rotation vectors (n, 3) in rad, by Rodrigues' formula."""
    angle = np.sqrt((vectors**2).sum(axis=1))[:, None, None]
    over = 1 / np.maximum(angle, np.finfo(float).tiny)
    cross = skew(vectors)
    bent = 2 * (np.sin(angle / 2) * over) ** 2
    return np.eye(3) + np.sin(angle) * over * cross + bent * (cross @ cross)


def _rotated(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return R v for one rotation or one a vector."""
    return (rotation @ vectors[:, :, None])[:, :, 0]


def _solved(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the solutions (n, 2) of n systems of two equations; not finite where singular."""
    (a, b), (c, d) = matrices.transpose(1, 2, 0)
    x, y = vectors.T
    return np.stack([d * x - b * y, a * y - c * x], axis=-1) / (a * d - b * c)[:, None]


def _imaged(calibration: FloatArray, distorted: FloatArray) -> FloatArray:
    """Return distorted places (n, 2) of the plane z = 1 in px."""
    f, cx, cy, affinity, shear = calibration.T[[0, 1, 2, 8, 9]]
    x, y = distorted.T
    return np.stack([cx + f * ((1 + affinity) * x + shear * y), cy + f * y], axis=-1)


def _sensor(calibration: FloatArray) -> FloatArray:
    """Return the derivatives (n, 2, 2) of image points by their distorted places."""
    f, affinity, shear = calibration.T[[0, 8, 9]]
    sensor = np.zeros((len(calibration), 2, 2))
    sensor[:, 0, 0] = f * (1 + affinity)
    sensor[:, 0, 1] = f * shear
    sensor[:, 1, 1] = f
    return sensor


def _sensor_by_parameter(calibration: FloatArray, distorted: FloatArray) -> FloatArray:
    """Return derivatives (n, 2, 5) by f, cx, cy, affinity and shear at kept distorted places."""
    f, affinity, shear = calibration.T[[0, 8, 9]]
    x, y = distorted.T
    derivative = np.zeros((len(distorted), 2, 5))
    derivative[:, 0, 0] = (1 + affinity) * x + shear * y
    derivative[:, 1, 0] = y
    derivative[:, 0, 1] = derivative[:, 1, 2] = 1
    derivative[:, 0, 3] = f * x
    derivative[:, 0, 4] = f * y
    return derivative


def _distortion(calibration: FloatArray, place: FloatArray, equidistant: Fisheye) -> FloatArray:
    """Return the distortion (n, 2) at places (n, 2) of the plane z = 1."""
    k1, k2, k3, p1, p2 = calibration.T[3:8]
    x, y = place.T
    r2 = x**2 + y**2
    radial = r2 * (k1 + r2 * (k2 + r2 * k3))
    brown = np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2),
            y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y,
        ],
        axis=-1,
    )
    if not np.any(equidistant):
        return brown
    radius, angle, _ = _angles(place)
    stretch = (_powers(angle) * _polynomial(calibration)).sum(axis=-1) / radius - 1
    return np.where(np.reshape(equidistant, (-1, 1)), stretch[:, None] * place, brown)


def _undistorted_fisheye(calibration: FloatArray, distorted: FloatArray) -> FloatArray:
    """Return about where distorted places (n, 2) of fisheye lenses come from, by their angles."""
    distance = np.maximum(np.linalg.norm(distorted, axis=1), _ON_AXIS)
    angle = np.minimum(distance, _WIDEST)
    for _ in range(_INVERSIONS):
        error = (_powers(angle) * _polynomial(calibration)).sum(axis=-1) - distance
        angle = np.clip(angle - error / _slope(calibration, angle), _ON_AXIS, _WIDEST)
    return distorted * (np.tan(angle) / distance)[:, None]


def _slope(calibration: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the derivatives (n,) of distances in the image of a fisheye lens by angles (n,)."""
    odd = np.arange(1, 10, 2)
    return (odd * angle[:, None] ** (odd - 1) * _polynomial(calibration)).sum(-1)


def _angles(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the distances (n,) of places from the axis, their angles in rad, and unit vectors."""
    radius = np.maximum(np.linalg.norm(place, axis=1), _ON_AXIS)
    return radius, np.arctan(radius), place / radius[:, None]


def _powers(angle: FloatArray) -> FloatArray:
    """Return t, t³, t⁵, t⁷ and t⁹ (n, 5) of angles (n,)."""
    return angle[:, None] ** np.arange(1, 10, 2)


def _polynomial(calibration: FloatArray) -> FloatArray:
    """Return 1, k1, k2, k3 and k4 of equidistant lenses."""
    return np.concatenate([np.ones_like(calibration[..., :1]), calibration[..., 3:7]], axis=-1)


def _distortion_by_place(
    calibration: FloatArray, place: FloatArray, equidistant: Fisheye
) -> FloatArray:
    """Return the derivatives (n, 2, 2), which are symmetric, of the distortion by its place."""
    k1, k2, k3, p1, p2 = calibration.T[3:8]
    x, y = place.T
    r2 = x**2 + y**2
    radial = r2 * (k1 + r2 * (k2 + r2 * k3))
    by_r2 = k1 + r2 * (2 * k2 + 3 * r2 * k3)
    derivative = np.empty((len(place), 2, 2))
    derivative[:, 0, 0] = radial + 2 * x**2 * by_r2 + 2 * p1 * y + 6 * p2 * x
    derivative[:, 1, 1] = radial + 2 * y**2 * by_r2 + 6 * p1 * y + 2 * p2 * x
    mixed = 2 * x * y * by_r2 + 2 * p1 * x + 2 * p2 * y
    derivative[:, 0, 1] = derivative[:, 1, 0] = mixed
    if not np.any(equidistant):
        return derivative
    radius, angle, along = _angles(place)
    across = (_powers(angle) * _polynomial(calibration)).sum(axis=-1) / radius
    outwards = _slope(calibration, angle) / (1 + radius**2)
    outer = along[:, :, None] * along[:, None, :]
    fisheye = outwards[:, None, None] * outer + across[:, None, None] * (np.eye(2) - outer)
    return np.where(np.reshape(equidistant, (-1, 1, 1)), fisheye - np.eye(2), derivative)


def distortion_by_coefficient(place: FloatArray, equidistant: Fisheye = False) -> FloatArray:
    """Return the derivatives (n, 2, 5) of the distortion by k1, k2, k3, p1 and p2.

    Brown's distortion at places (n, 2) of the plane z = 1 is linear in its coefficients. Those of
    an equidistant lens are k1, k2, k3 and k4.
    """
    x, y = place.T
    r2 = x**2 + y**2
    derivative = np.empty((len(place), 2, 5))
    derivative[:, :, :3] = place[:, :, None] * (r2[:, None] ** [1, 2, 3])[:, None, :]
    derivative[:, 0, 3] = derivative[:, 1, 4] = 2 * x * y
    derivative[:, 1, 3] = r2 + 2 * y**2
    derivative[:, 0, 4] = r2 + 2 * x**2
    if not np.any(equidistant):
        return derivative
    _, angle, along = _angles(place)
    fisheye = np.zeros_like(derivative)
    fisheye[:, :, :4] = along[:, :, None] * _powers(angle)[:, None, 1:]
    return np.where(np.reshape(equidistant, (-1, 1, 1)), fisheye, derivative)
