"""Positions in space of targets, from an organised cloud that belongs to their image.

A target is flat. What a scanner measures on it, on paper that it sees well and on ink that it sees
badly or not at all, lies on a plane, and the image of a plane is a homography: with the offsets
(u, v) of a pixel from the centre of the target, its point is

    P(u, v) = (a + b u + c v) / (1 + g u + h v),

and P(0, 0) = a is the position. This holds in any frame of the cloud, for any pinhole camera; of
the distortion of a lens only what is linear across a target is in it. Eleven numbers are fitted to
about a thousand points by least squares, without the outliers of a first plane, the best in the
median.

`benchmarks/positions.py` compares: with noise of 0.1 mm at a metre, a dot of 20 px and 45 degrees
of tilt, positions are 0.005 mm off, those of the four nearest points 0.08 mm, and those of a fit
without g and h 0.32 mm, for want of the perspective. With ink that is four times as noisy and a
dot without any points the homography is 0.007 mm off; four neighbours give nothing then. For such
a dot, seen at 17 degrees from the axis, distortion of k1 = 0.1 adds 0.01 mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ahf_ros.interchange.point_clouds import AXES
from ahf_ros.target import Target

NEIGHBOURHOOD = 3.0
"""Radius of the neighbourhood of a centre, in radii of its dot: not beyond the band of a code."""

LEAST_POINTS = 12
"""Fewest points that a position is fitted to."""

_LARGEST = float(np.finfo(np.float32).max)  # coordinate; its square is finite in float64
_LEAST_REACH = 5.0  # px, of a neighbourhood, also of targets whose size is not known
_MOST_POINTS = 1024  # about, of a neighbourhood; larger ones are thinned out
_LEAST_SHARE = 0.2  # of the pixels of a neighbourhood, that must have points on its plane
_FARTHEST = 2.0  # standard deviations of these points, from their middle to the centre
_TRIALS, _JUDGES = 64, 200  # planes through three points, and points that choose among them
_LEAST_AREA = 0.1  # of three points, in units of the reach
_SPREADS = np.array([0.8191725134, 0.6710436067, 0.5497004779])  # Roberts' sequence in 3-D
_DEVIATION = 1.4826  # standard deviations, of normal noise, in the median of its magnitude
_OUTLIER = 3.0  # standard deviations
_PASSES = 3


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """Where targets are, in the frame and unit of a cloud; one row a target, in their order.

    Attributes
    ----------
    points : ndarray of float64, shape (n, 3)
        x, y, z of the centres; NaN where the cloud does not tell.
    deviations : ndarray of float64, shape (n,)
        Root mean square of the distances of the points of a neighbourhood from where the plane
        has them: the noise of the scanner, or more where a target is not flat.
    spacings : ndarray of float64, shape (n,)
        Distance on the target of what the image shows a pixel apart, the larger one of both axes.
    """

    points: np.ndarray
    deviations: np.ndarray
    spacings: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """Which targets have a position, shape (n,)."""
        return np.isfinite(self.points[:, 2])


def positions(
    cloud: np.ndarray, targets: Sequence[Target], neighbourhood: float = NEIGHBOURHOOD
) -> Positions:
    """Return the positions of targets.

    A target has none where fewer than `LEAST_POINTS` or a fifth of the pixels about it have points
    of its plane, or where these are all on one side of it: nothing is extrapolated.

    Parameters
    ----------
    cloud : ndarray of shape (height, width), with the fields x, y and z
        As `ahf_ros.interchange.point_clouds.organised_points` returns it. A point that is not
        finite in float32, or that is 0, 0, 0, is none.
    targets : sequence of Target, or of ahf_ros/CodedTarget
        In the pixels of the image that the cloud belongs to.
    neighbourhood : float
        Radius about a centre within which points count, in radii of its dot, which is taken as
        the ellipse that the image shows.
    """
    rows = np.full((len(targets), 5), np.nan)
    with np.errstate(all='ignore'):  # garbage leads to what is not finite
        for row, target in zip(rows, targets, strict=True):
            offsets, points, pixels = _neighbours(cloud, target, neighbourhood)
            if len(points) >= max(LEAST_POINTS, _LEAST_SHARE * pixels):
                with suppress(np.linalg.LinAlgError):
                    row[:] = _position(offsets, points, _LEAST_SHARE * pixels)
    rows[~np.isfinite(rows).all(axis=1)] = np.nan
    return Positions(rows[:, :3], rows[:, 3], rows[:, 4])


def _neighbours(
    cloud: np.ndarray, target: Target, neighbourhood: float
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return offsets (n, 2) in px and points (n, 3) about a target, and the number of pixels."""
    shape = (target.x, target.y, target.semi_major, target.semi_minor, target.angle)
    if not all(map(math.isfinite, shape)):
        return np.empty((0, 2)), np.empty((0, 3)), 0
    reach = [max(_LEAST_REACH, neighbourhood * axis) for axis in shape[2:4]]
    places = []
    for centre, size in ((target.y, cloud.shape[0]), (target.x, cloud.shape[1])):
        first = math.ceil(min(size, max(0, centre - reach[0])))
        last = math.floor(min(size - 1, max(-1, centre + reach[0])))
        places.append((first, max(first, last + 1)))
    count = math.prod(end - first for first, end in places)
    step = max(1, math.ceil(math.sqrt(count / _MOST_POINTS)))
    window = tuple(slice(first, end, step) for first, end in places)
    rows, columns = np.mgrid[window]
    offsets = np.stack((columns - target.x, rows - target.y), axis=-1)
    turn = np.array(
        [
            [math.cos(target.angle), -math.sin(target.angle)],
            [math.sin(target.angle), math.cos(target.angle)],
        ]
    )
    inside = (((offsets @ turn) / reach) ** 2).sum(axis=-1) <= 1
    near = cloud[window][inside]
    points = np.stack([near[name].astype(np.float64) for name in AXES], axis=-1)
    real = (np.abs(points) <= _LARGEST).all(axis=1) & points.any(axis=1)
    return offsets[inside][real], points[real], int(inside.sum())


def _position(offsets: np.ndarray, points: np.ndarray, least: float) -> list[float]:
    """Return position, deviation and spacing of a target; NaN where the points do not tell."""
    unknown = [math.nan] * 5
    reach = np.abs(offsets).max()
    unit = offsets / reach
    origin = np.median(points, axis=0)
    shifted = points - origin
    distances = _distances_from_median_plane(unit, shifted)
    if distances is None:
        return unknown
    floor = 1e-6 * np.abs(shifted).max()
    for _ in range(_PASSES):
        near = distances <= max(_OUTLIER * _DEVIATION * np.median(distances), floor)
        if near.sum() < max(LEAST_POINTS, least) or _outside(unit[near]):
            return unknown
        plane, perspective = _homography(unit[near], shifted[near])
        seen = plane[0] + unit @ plane[1:]
        distances = np.linalg.norm(shifted - seen / (1 + unit @ perspective)[:, None], axis=1)
    deviation = math.sqrt(np.mean(distances[near] ** 2))
    across = (plane[1:] - np.outer(perspective, plane[0])) / reach
    spacing = np.linalg.norm(across, axis=1).max()
    return [*(origin + plane[0]), deviation, float(spacing)]


def _distances_from_median_plane(unit: np.ndarray, shifted: np.ndarray) -> np.ndarray | None:
    """Return distances from the affine plane through three points that is best in the median.

    Least median of squares [1]_, from triples that are spread evenly over the points [2]_; None
    where all points are on a line.

    References
    ----------
    .. [1] Rousseeuw, P. J. Least median of squares regression. JASA 1984, 79, 871.
    .. [2] Roberts, M. The unreasonable effectiveness of quasirandom sequences, 2018.
    """
    design = np.column_stack((np.ones(len(unit)), unit))
    triples = (np.arange(1, _TRIALS + 1)[:, None] * _SPREADS % 1 * len(unit)).astype(int)
    wide = np.abs(np.linalg.det(design[triples])) > 2 * _LEAST_AREA
    triples = triples[wide]
    if not len(triples):
        return None
    planes = np.linalg.solve(design[triples], shifted[triples])
    judges = slice(None, None, max(1, len(unit) // _JUDGES))
    errors = np.linalg.norm(design[judges] @ planes - shifted[judges], axis=-1)
    best = planes[np.median(errors, axis=1).argmin()]
    return np.linalg.norm(design @ best - shifted, axis=1)


def _homography(unit: np.ndarray, shifted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (a, b, c), shape (3, 3), and (g, h) of the best homography from offsets to points.

    It is linear in them: P = a + b u + c v - (g u + h v) P. What a, b and c can explain is taken
    off both sides first, so that two unknowns are left.
    """
    design = np.column_stack((np.ones(len(unit)), unit))
    sides = np.stack((shifted, -unit[:, :1] * shifted, -unit[:, 1:] * shifted), axis=1)
    planes = np.linalg.lstsq(design, sides.reshape(-1, 9), rcond=None)[0].reshape(3, 3, 3)
    left = sides - np.tensordot(design, planes, 1)
    regressors = left[:, 1:].transpose(0, 2, 1).reshape(-1, 2)
    perspective = np.linalg.lstsq(regressors, left[:, 0].ravel(), rcond=None)[0]
    return planes[:, 0] - np.tensordot(planes[:, 1:], perspective, (1, 0)), perspective


def _outside(unit: np.ndarray) -> bool:
    """Return whether the centre lies off the points, which are all on one side of it then."""
    middle = unit.mean(axis=0)
    spread = np.cov(unit.T)
    if np.linalg.det(spread) < 1e-6:
        return True
    return bool(middle @ np.linalg.solve(spread, middle) > _FARTHEST**2)
