"""Positions of targets in space, from an organised point cloud of the same view as their image.

A target is flat. The points that a scanner measures on it, well on paper and poorly or not at all
on ink, lie on a plane, which a homography maps to the image. A pixel at the offset (u, v) from the
centre of the target has the point

    P(u, v) = (a + b u + c v) / (1 + g u + h v),

and P(0, 0) = a is the position. This holds in any frame of the cloud and for any pinhole camera,
and for lens distortion as far as it is linear across a target. Eleven numbers are fitted by least
squares to about a thousand points, less the outliers of a plane of least median error.

On simulated clouds with 0.1 mm of noise at one metre, a dot of 20 px and 45 degrees of tilt,
positions are 0.005 mm off; those of the four nearest points are 0.08 mm off, and those of a fit
without perspective, g and h, 0.32 mm. With ink four times as noisy and no points on the dot, the
homography is 0.007 mm off and the four nearest points give no position. For such a dot, 17 degrees
off the axis, a distortion of k1 = 0.1 adds 0.01 mm.

The covariance of a position is that of a, from the residuals of the fit, whatever their
distribution over the directions, plus that of the centre in the image, which P takes into space.
It counts the noise of the points as independent of each other, and is never zero: positions are
rounded to float32.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.clouds.cloud_settings import FULL, NEIGHBOURHOOD, CloudGrid
from ahf_ros.clouds.point_clouds import COVARIANCE, TARGET_POINT
from ahf_ros.files.cloud_files import AXES
from ahf_ros.vision.robust import NORMAL

MINIMUM_POINTS = 12
"""Minimum number of points that a position is fitted to; there are eleven unknowns."""

_MAXIMUM_COORDINATE = float(np.finfo(np.float32).max)  # its square is finite in float64
_MINIMUM_REACH = 5.0  # steps of the grid; also the neighbourhood of targets of unknown size
_MAXIMUM_POINTS = 1024  # about; larger neighbourhoods are subsampled
_MINIMUM_SHARE = 0.2  # of the pixels of a neighbourhood that must have points on its plane
_MAXIMUM_OFFSET = 2.0  # from the mean of these points to the centre, standard deviations
_TRIALS, _JUDGES = 64, 200  # planes through three points, and points that judge them
_MINIMUM_AREA = 0.1  # of the triangle of three points, squared reaches
_SPREADS = np.array([0.8191725134, 0.6710436067, 0.5497004779])  # Roberts' sequence in 3-D
_OUTLIER = 3.0  # standard deviations
_PASSES = 3
_TRIMMED = 1.056
"""Variance of a mean without outliers beyond `_OUTLIER` over that estimated from the rest.

This is for noise in one direction, as along the rays of a scanner: of a standard normal variable
with density f, P = 0.9973 are within c = 3, with the mean square V = 0.9733 of these. Its mean has
the variance P V / (P - 2 c f(c))^2 (Huber, Robust Statistics, 1981, 3.2), and V / P is estimated.
"""
_UNKNOWNS = 11
_CENTRE = 0.05  # px, standard deviation of centres whose covariance is not known


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """Positions of n targets in the frame and unit of a cloud, NaN where unknown.

    Points of shape (n, 3) are x, y, z of the centres. Deviations, shape (n,), are the root mean
    square of the residuals of the fit: the noise of the scanner, or more if a target is not flat.
    Spacings, shape (n,), are the distances on the target of two adjacent pixels, along the axis
    where they are larger. Covariances, shape (n, 3, 3), are those of the points.
    """

    points: np.ndarray
    deviations: np.ndarray
    spacings: np.ndarray
    covariances: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """Whether each target has a position, shape (n,)."""
        return np.isfinite(self.points[:, 2])


def positions(
    cloud: np.ndarray,
    targets: Sequence[Target],
    neighbourhood: float = NEIGHBOURHOOD,
    grid: CloudGrid = FULL,
) -> Positions:
    """Return the positions of targets, `Target` or ahf_ros/CodedTarget, px of the image.

    The cloud, of shape (height, width) with the fields x, y and z, is one that
    `ahf_ros.clouds.point_clouds.organised_points` returns. Points that are not finite in
    float32 or that are 0, 0, 0 are missing. Those within `neighbourhood` radii of the dot, an
    ellipse, from its centre count. A target has no position if fewer than `MINIMUM_POINTS`, or
    less than a fifth, of the pixels around it have points on its plane, or if all of these are on
    one side of its centre: nothing is extrapolated.
    """
    rows = np.full((len(targets), 14), np.nan)
    with np.errstate(all='ignore'):  # bad points end in values that are not finite
        for row, target in zip(rows, targets, strict=True):
            offsets, points, pixels = _neighbours(cloud, target, neighbourhood, grid)
            minimum = max(MINIMUM_POINTS, _MINIMUM_SHARE * pixels)
            if len(points) >= minimum:
                with suppress(np.linalg.LinAlgError):
                    centre = _centre_covariance(target) / grid.step**2
                    row[:] = _position(offsets, points, minimum, centre)
    rows[~np.isfinite(rows).all(axis=1)] = np.nan
    return Positions(
        rows[:, :3], rows[:, 3], rows[:, 4] / grid.step, rows[:, 5:].reshape(-1, 3, 3)
    )


def labelled(targets: Sequence[Target], found: Positions) -> np.ndarray:
    """Return one `TARGET_POINT` per target, in their order; NaN if it has no position."""
    points = np.empty(len(targets), TARGET_POINT)
    for axis, name in enumerate(AXES):
        points[name] = found.points[:, axis]
    points['id'] = [target.id for target in targets]
    points['confidence'] = [target.confidence for target in targets]
    points['deviation'] = found.deviations
    rows, columns = np.triu_indices(3)
    for name, values in zip(COVARIANCE, found.covariances[:, rows, columns].T, strict=True):
        points[name] = values
    return points


def _centre_covariance(target: Target) -> np.ndarray:
    """Return the covariance (2, 2) of a centre, px^2; detectors say zero where it is not known."""
    given = np.array(target.covariance, float).reshape(2, 2)
    return given if given.any() else _CENTRE**2 * np.eye(2)


def _neighbours(
    cloud: np.ndarray, target: Target, neighbourhood: float, grid: CloudGrid
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return offsets (n, 2) and points (n, 3) near a target, and the number of places in reach.

    Offsets are in steps of the grid.
    """
    sizes = target.semi_major, target.semi_minor
    # As in messages, so that a position is the same in whatever way the target came.
    angle = float(np.float32(target.angle))
    if not all(map(math.isfinite, (target.x, target.y, *sizes, angle))):
        return np.empty((0, 2)), np.empty((0, 3)), 0
    axes = [float(np.float32(min(it, _MAXIMUM_COORDINATE))) for it in sizes]
    reach = [max(_MINIMUM_REACH, neighbourhood * axis / grid.step) for axis in axes]
    x, y = (target.x - grid.offset_x) / grid.step, (target.y - grid.offset_y) / grid.step
    places = []
    for centre, size in ((y, cloud.shape[0]), (x, cloud.shape[1])):
        first = math.ceil(min(size, max(0, centre - reach[0])))
        last = math.floor(min(size - 1, max(-1, centre + reach[0])))
        places.append((first, max(first, last + 1)))
    count = math.prod(end - first for first, end in places)
    step = max(1, math.ceil(math.sqrt(count / _MAXIMUM_POINTS)))
    window = tuple(slice(first, end, step) for first, end in places)
    rows, columns = np.mgrid[window]
    offsets = np.stack((columns - x, rows - y), axis=-1)
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    inside = (((offsets @ turn) / reach) ** 2).sum(axis=-1) <= 1
    near = cloud[window][inside]
    points = np.stack([near[name].astype(np.float64) for name in AXES], axis=-1)
    real = (np.abs(points) <= _MAXIMUM_COORDINATE).all(axis=1) & points.any(axis=1)
    return offsets[inside][real], points[real], int(inside.sum())


def _position(
    offsets: np.ndarray, points: np.ndarray, minimum: float, centre: np.ndarray
) -> np.ndarray:
    """Return position, deviation, spacing and covariance of a target, in a row of 14.

    The covariance of the centre is in steps of the grid. Raises LinAlgError if points are few.
    """
    reach = np.abs(offsets).max()
    unit = offsets / reach
    origin = np.median(points, axis=0)
    shifted = points - origin
    distances = _distances_from_median_plane(unit, shifted)
    floor = 1e-6 * np.abs(shifted).max()
    for _ in range(_PASSES):
        near = distances <= max(_OUTLIER * NORMAL * np.median(distances), floor)
        if near.sum() < minimum or _outside(unit[near]):
            raise np.linalg.LinAlgError('too few points are on the plane, or all on one side')
        plane, perspective = _homography(unit[near], shifted[near])
        seen = plane[0] + unit @ plane[1:]
        residuals = shifted - seen / (1 + unit @ perspective)[:, None]
        distances = np.linalg.norm(residuals, axis=1)
    deviation = math.sqrt(np.mean(distances[near] ** 2))
    across = (plane[1:] - np.outer(perspective, plane[0])) / reach
    spacing = np.linalg.norm(across, axis=1).max()
    position = origin + plane[0]
    covariance = _covariance(unit[near], shifted[near], residuals[near], perspective)
    covariance += across.T @ centre @ across + np.diag(_rounding(position))
    return np.concatenate((position, [deviation, spacing], covariance.ravel()))


def _covariance(
    unit: np.ndarray, shifted: np.ndarray, residuals: np.ndarray, perspective: np.ndarray
) -> np.ndarray:
    """Return the covariance (3, 3) of P(0, 0) from the residuals of its homography.

    An error of point i changes the eleven unknowns by N^-1 J_i' (1 + g u_i + h v_i) times the
    error, with the rows J_i of `_homography` and N as the sum of J_i' J_i.
    """
    count = len(unit)
    design = np.zeros((count, 3, _UNKNOWNS))
    for column, values in enumerate((np.ones(count), *unit.T)):
        for axis in range(3):
            design[:, axis, 3 * column + axis] = values
    design[:, :, 9:] = -shifted[:, :, None] * unit[:, None, :]
    flat = design.reshape(-1, _UNKNOWNS)
    solver = np.linalg.pinv(flat.T @ flat, hermitian=True)[:3]
    gains = np.einsum('uk,nak->nua', solver, design) * (1 + unit @ perspective)[:, None, None]
    noise = _TRIMMED * residuals.T @ residuals / (count - _UNKNOWNS / 3)
    return np.einsum('nua,ab,nvb->uv', gains, noise, gains, optimize=True)


def _rounding(position: np.ndarray) -> np.ndarray:
    """Return the variances (3,) of rounding the coordinates of a point to float32."""
    steps = np.finfo(np.float32).eps * max(np.abs(position).max(), np.finfo(np.float32).tiny)
    return np.full(3, steps**2 / 12)


def _distances_from_median_plane(unit: np.ndarray, shifted: np.ndarray) -> np.ndarray:
    """Return distances from the affine plane through three points with the least median error.

    This is least median of squares (Rousseeuw, JASA 1984, 79, 871) with triples that Roberts'
    sequence (The unreasonable effectiveness of quasirandom sequences, 2018) spreads evenly over
    the points.
    """
    design = np.column_stack((np.ones(len(unit)), unit))
    triples = (np.arange(1, _TRIALS + 1)[:, None] * _SPREADS % 1 * len(unit)).astype(int)
    triples = triples[np.abs(np.linalg.det(design[triples])) > 2 * _MINIMUM_AREA]
    if not len(triples):
        raise np.linalg.LinAlgError('all points are on a line')
    planes = np.linalg.solve(design[triples], shifted[triples])
    judges = slice(None, None, max(1, len(unit) // _JUDGES))
    errors = np.linalg.norm(design[judges] @ planes - shifted[judges], axis=-1)
    best = planes[np.median(errors, axis=1).argmin()]
    return np.linalg.norm(design @ best - shifted, axis=1)


def _homography(unit: np.ndarray, shifted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (a, b, c), shape (3, 3), and (g, h) of the best homography from offsets to points.

    It is linear in them: P = a + b u + c v - (g u + h v) P. The parts of both sides that a, b and
    c can explain are removed first, so that two unknowns remain.
    """
    design = np.column_stack((np.ones(len(unit)), unit))
    sides = np.stack((shifted, -unit[:, :1] * shifted, -unit[:, 1:] * shifted), axis=1)
    planes = np.linalg.lstsq(design, sides.reshape(-1, 9), rcond=None)[0].reshape(3, 3, 3)
    left = sides - np.tensordot(design, planes, 1)
    regressors = left[:, 1:].transpose(0, 2, 1).reshape(-1, 2)
    perspective = np.linalg.lstsq(regressors, left[:, 0].ravel(), rcond=None)[0]
    return planes[:, 0] - np.tensordot(planes[:, 1:], perspective, (1, 0)), perspective


def _outside(unit: np.ndarray) -> bool:
    """Return whether the points are all on one side of the centre."""
    middle = unit.mean(axis=0)
    spread = np.cov(unit.T)
    if np.linalg.det(spread) < 1e-6:
        return True
    return bool(middle @ np.linalg.solve(spread, middle) > _MAXIMUM_OFFSET**2)
