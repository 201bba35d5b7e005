"""The pose of one image of known points by least squares, and tests of its points.

Image points are weighted by their covariances and by those of the coordinates [1]_. Points are
tested as those of networks are, by the decrease of the sum of squares without them [2]_.

References
----------
.. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, sections 4.4 and 12.2.
.. [2] Baarda, A testing procedure for use in geodetic networks, 1968.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ahf_ros.network.camera import pinhole
from ahf_ros.network.image_points import BEHIND, robust_spread
from ahf_ros.network.network import FloatArray, IntArray
from ahf_ros.network.planar import mirrored
from ahf_ros.network.points import entries
from ahf_ros.network.resection import Resection, resections
from ahf_ros.network.solution import NetworkState
from ahf_ros.network.testing import CRITICAL

ROUNDS = 20
"""Steps of a fit, and rounds of tests."""

SIGNIFICANCE = 0.025
"""Error probability of the test whether the sum of squares is larger than by chance."""

_CONVERGED = 1e-9  # decrease of the sum of weighted squares that a step promises
_FEW_ROUNDS = 6
_BENT = 4  # times that the sum of squares grows less than a covariance says, where it is none
_SAME = 1e-4  # share of the distance that points move between poses of about the same weights

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Sight:
    """Known points (n, 3) at places (n, 2) of the plane z = 1, with both covariances.

    Those of the places are (n, 2, 2), that of all coordinates is (3n, 3n).
    """

    points: FloatArray
    places: FloatArray
    covariances: FloatArray
    of_points: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations (n,) of a coordinate of the places, the mean of both."""
        return np.sqrt(np.trace(self.covariances, axis1=1, axis2=2) / 2)

    def chosen(self, rows: IntArray) -> Sight:
        """Return some of the points."""
        some = entries(rows)
        return Sight(
            self.points[rows],
            self.places[rows],
            self.covariances[rows],
            self.of_points[np.ix_(some, some)],
        )


@dataclass(frozen=True)
class Fit:
    """A pose of least squares: X_camera = R (X - position).

    `cofactors` (6, 6) are of (position, rotation vector in the camera's frame), `lengths` (n,) the
    residuals of all points over their standard deviations, as Baarda's test has them.
    """

    rotation: FloatArray
    position: FloatArray
    used: Mask
    cost: float
    cofactors: FloatArray
    lengths: FloatArray

    @property
    def redundancy(self) -> int:
        """Observations beyond those that a pose needs."""
        return 2 * int(self.used.sum()) - 6

    @property
    def by_chance(self) -> float:
        """Probability of at least this sum of squares.

        The redundancy is even, so that the distribution is a sum of Poisson's (Abramowitz and
        Stegun 1964, 26.4.21).
        """
        half, terms = self.cost / 2, np.arange(self.redundancy // 2)
        logarithms = terms * math.log(max(half, 1e-300)) - half
        return float(np.exp(logarithms - [math.lgamma(term + 1) for term in terms]).sum())

    @property
    def plausible(self) -> bool:
        """Whether the sum of squares is that of these weights, and not larger."""
        return self.redundancy <= 0 or self.by_chance > SIGNIFICANCE

    @property
    def spread(self) -> float:
        """Standard deviation of unit weight that points are tested with."""
        return 1.0 if self.plausible else max(1.0, robust_spread(self.lengths[self.used]))

    def worst(self) -> int:
        """Return the used point that fits least."""
        return int(np.argmax(np.where(self.used, self.lengths, 0)))


def tested_fit(sight: Sight) -> Fit | None:
    """Return the pose on which most points agree; None where none is found.

    Points that do not agree are off, by tests one by one, off and on again. Where all agree, as
    nearly always, a direct solution is the start.
    """
    every = np.ones(len(sight.points), bool)
    start = direct(sight)
    result = fitted(sight, every, *start) if start else None
    if result and result.lengths.max() < CRITICAL * result.spread and result.spread == 1:
        return result
    robust = agreeing(sight)
    if not robust or robust.agrees.sum() < 4:
        return result
    used, rotation, position = robust.agrees, robust.rotation, robust.position
    returned = ~every
    for _ in range(ROUNDS):
        found = fitted(sight, used, rotation, position)
        if not found:
            return result
        result, rotation, position = found, found.rotation, found.position
        lengths = found.lengths / found.spread
        on = ~used & (lengths < CRITICAL) & ~returned
        off = np.zeros_like(used)
        off[found.worst()] = lengths[found.worst()] > CRITICAL
        if not (on | off).any() or used.sum() <= 4:
            break
        returned |= on
        used = (used & ~off) | on
    return result


def direct(sight: Sight) -> tuple[FloatArray, FloatArray] | None:
    """Return the pose of all points by SQPnP (Terzakis and Lourakis, ECCV 2020).

    OpenCV asserts bounds that are not relative, so that points are scaled.
    """
    centre = sight.points.mean(axis=0)
    scale = np.abs(sight.points - centre).max()
    try:
        count, turns, shifts, _ = cv2.solvePnPGeneric(
            (sight.points - centre) / scale,
            sight.places,
            np.eye(3),
            None,
            flags=cv2.SOLVEPNP_SQPNP,
        )
    except cv2.error:
        return None
    for turn, shift in zip(turns[:count], shifts[:count], strict=True):
        rotation = np.asarray(cv2.Rodrigues(turn)[0], float)
        position = centre - scale * rotation.T @ shift.ravel()
        if np.isfinite(rotation).all() and np.isfinite(position).all():
            return rotation, position
    return None


def agreeing(sight: Sight) -> Resection | None:
    """Return the robust pose of points of which some are wrong."""
    found = resections(sight.points, sight.places, sight.sigma)
    return found[0] if found else None


def other_fit(sight: Sight, fit: Fit, unlikely: float) -> Fit | None:
    """Return a pose beyond Necker's reversal at which the same points fit about as well.

    None if the sum of squares is larger by `unlikely` there, or no smaller than the covariance of
    the fit says. A pose that matters is near the reversal, so that a few steps find it; where two
    minima merge, it may be none.
    """
    rows = np.flatnonzero(fit.used)
    part = sight.chosen(rows)
    state = NetworkState(
        calibrations=pinhole(1.0, 1, 1)[None],
        rotations=fit.rotation[None],
        positions=fit.position[None],
        points=part.points,
        used=np.ones(len(rows), bool),
    )
    start = mirrored(state)
    rotation, position = start.rotations[0], start.positions[0]
    if _seen(part.points, rotation, position)[:, 2].min() <= 0:
        return None
    whitening = _whitening(part, rotation, position)
    found = _minimised(part, whitening, rotation, position, _FEW_ROUNDS)
    if found is None:
        return None
    other = _rated(sight, part, rows, whitening, *found)
    if other is None or other.cost >= fit.cost + unlikely:
        return None
    turn = cv2.Rodrigues(other.rotation @ fit.rotation.T)[0].ravel()
    gap = np.concatenate((other.position - fit.position, turn))
    scale = np.sqrt(np.diag(fit.cofactors))
    whitened = np.linalg.solve(fit.cofactors / np.outer(scale, scale), gap / scale)
    return other if gap / scale @ whitened > _BENT * unlikely else None


def fitted(sight: Sight, used: Mask, rotation: FloatArray, position: FloatArray) -> Fit | None:
    """Return the weighted least-squares fit of the used points (n,) from a start.

    None if the start has used points behind the camera, or the points do not determine a pose.
    """
    rows = np.flatnonzero(used)
    part = sight.chosen(rows)
    if _seen(part.points, rotation, position)[:, 2].min() <= 0:
        return None
    for _ in range(ROUNDS):
        whitening = _whitening(part, rotation, position)
        moved = _minimised(part, whitening, rotation, position)
        if moved is None:
            return None
        before = _seen(part.points, rotation, position)
        rotation, position = moved
        after = _seen(part.points, rotation, position)
        # Weights that follow from coordinates depend on the pose that they are computed at.
        if np.abs(after - before).max() < _SAME * after[:, 2].min() or not part.of_points.any():
            break
    return _rated(sight, part, rows, whitening, rotation, position)


def _minimised(
    part: Sight,
    whitening: FloatArray,
    rotation: FloatArray,
    position: FloatArray,
    rounds: int = ROUNDS,
) -> tuple[FloatArray, FloatArray] | None:
    """Return the pose of least squares by Gauss-Newton steps, halved until the sum decreases."""
    seen = _seen(part.points, rotation, position)
    rest = whitening @ _misclosure(part, seen)
    for _ in range(rounds):
        jacobian = whitening @ _by_pose(seen, rotation)
        normal, right = jacobian.T @ jacobian, jacobian.T @ rest
        scale = np.sqrt(np.diag(normal))
        if not (scale > 0).all():
            return None
        try:
            step = np.linalg.solve(normal / np.outer(scale, scale), right / scale) / scale
        except np.linalg.LinAlgError:
            return None
        if step @ right < _CONVERGED:
            break
        before = rest @ rest
        for _ in range(ROUNDS):
            turned = cv2.Rodrigues(step[3:])[0] @ rotation
            moved = position + step[:3]
            seen = _seen(part.points, turned, moved)
            rest = whitening @ _misclosure(part, seen)
            if seen[:, 2].min() > 0 and rest @ rest < before:
                break
            step = step / 2
        else:
            break
        rotation, position = turned, moved
    return rotation, position


def _rated(
    sight: Sight,
    part: Sight,
    rows: IntArray,
    whitening: FloatArray,
    rotation: FloatArray,
    position: FloatArray,
) -> Fit | None:
    """Return the fit at its minimum, with the tests of all points."""
    seen = _seen(part.points, rotation, position)
    misclosure, design = _misclosure(part, seen), _by_pose(seen, rotation)
    weights = whitening.T @ whitening
    weighted = weights @ design
    normal = design.T @ weighted
    scale = np.sqrt(np.diag(normal))
    try:
        cofactors = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(cofactors).all() or np.diag(cofactors).min() <= 0:
        return None
    used = np.zeros(len(sight.points), bool)
    used[rows] = True
    lengths = np.full(len(used), BEHIND)
    # The decrease of the sum of squares without a point, also where points are correlated.
    of_rest = _own_blocks(weights - weighted @ cofactors @ weighted.T)
    pull = (weights @ misclosure).reshape(-1, 2)
    lengths[rows] = _mahalanobis(pull, of_rest)
    others = np.flatnonzero(~used)
    others = others[_depths(sight.points[others], rotation, position) > 0]
    if len(others):
        rest = sight.chosen(others)
        seen = _seen(rest.points, rotation, position)
        missed, by_pose = _misclosure(rest, seen), _by_pose(seen, rotation)
        of_missed = _covariance(rest, rotation, position) + by_pose @ cofactors @ by_pose.T
        lengths[others] = _mahalanobis(missed.reshape(-1, 2), _own_blocks(of_missed))
    cost = float(misclosure @ weights @ misclosure)
    return Fit(rotation, position, used, cost, (cofactors + cofactors.T) / 2, lengths)


def residuals(sight: Sight, fit: Fit) -> FloatArray:
    """Return measured minus computed places (n, 2) of the used points."""
    part = sight.chosen(np.flatnonzero(fit.used))
    return _misclosure(part, _seen(part.points, fit.rotation, fit.position)).reshape(-1, 2)


def nearest(sight: Sight, fit: Fit, place: int, points: FloatArray) -> tuple[int, float]:
    """Return which of other points (k, 3) is imaged nearest to a measured place, and how far.

    The distance is in standard deviations of the place.
    """
    before = np.where(_depths(points, fit.rotation, fit.position)[:, None] > 0, points, np.nan)
    seen = (before - fit.position) @ fit.rotation.T
    gaps = sight.places[place] - seen[:, :2] / seen[:, 2:]
    inverse = np.linalg.inv(sight.covariances[place])
    lengths = np.nan_to_num(np.sqrt(np.einsum('ni,ij,nj->n', gaps, inverse, gaps)), nan=np.inf)
    best = int(np.argmin(lengths))
    return best, float(lengths[best])


def _depths(points: FloatArray, rotation: FloatArray, position: FloatArray) -> FloatArray:
    return (points - position) @ rotation[2]


def _seen(points: FloatArray, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Return points (n, 3) in the frame of the camera."""
    return (points - position) @ rotation.T


def _misclosure(part: Sight, seen: FloatArray) -> FloatArray:
    """Return measured minus computed places (2n,) of points in the frame of the camera."""
    return (part.places - seen[:, :2] / seen[:, 2:]).ravel()


def _by_seen(seen: FloatArray) -> FloatArray:
    """Return the derivatives (n, 2, 3) of places by points in the frame of the camera."""
    inverse = 1 / seen[:, 2]
    derivative = np.zeros((len(seen), 2, 3))
    derivative[:, 0, 0] = derivative[:, 1, 1] = inverse
    derivative[:, :, 2] = -seen[:, :2] * (inverse**2)[:, None]
    return derivative


def _by_pose(seen: FloatArray, rotation: FloatArray) -> FloatArray:
    """Return the derivatives (2n, 6) of places by position and turn, R <- exp([r]x) R."""
    x, y = (seen[:, :2] / seen[:, 2:]).T
    derivative = np.empty((len(seen), 2, 6))
    derivative[:, :, :3] = -_by_seen(seen) @ rotation
    derivative[:, 0, 3:] = np.column_stack((-x * y, 1 + x**2, -y))
    derivative[:, 1, 3:] = np.column_stack((-1 - y**2, x * y, x))
    return derivative.reshape(-1, 6)


def _covariance(part: Sight, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Return the covariance (2n, 2n) of measured minus computed, with that of the coordinates."""
    count = len(part.points)
    covariance = np.zeros((2 * count, 2 * count))
    if part.of_points.any():
        by_point = _by_seen(_seen(part.points, rotation, position)) @ rotation
        half = by_point @ part.of_points.reshape(count, 3, 3 * count)
        whole = by_point @ half.reshape(2 * count, count, 3).transpose(1, 2, 0)
        covariance = whole.reshape(2 * count, 2 * count)
    each = np.arange(count)
    covariance.reshape(count, 2, count, 2)[each, :, each] += part.covariances
    return covariance


def _whitening(part: Sight, rotation: FloatArray, position: FloatArray) -> FloatArray:
    """Return the matrix (2n, 2n) that makes errors of unit weight of those of the places."""
    return np.linalg.inv(np.linalg.cholesky(_covariance(part, rotation, position)))


def _own_blocks(matrix: FloatArray) -> FloatArray:
    """Return the blocks (n, 2, 2) on the diagonal of a matrix (2n, 2n)."""
    count = len(matrix) // 2
    each = np.arange(count)
    return matrix.reshape(count, 2, count, 2)[each, :, each]


def _mahalanobis(vectors: FloatArray, covariances: FloatArray) -> FloatArray:
    """Return lengths (n,) of vectors (n, 2) in the metric of their covariances.

    That of a point that no other checks is singular: its length is zero.
    """
    sizes, axes = np.linalg.eigh(covariances)
    along = (axes.transpose(0, 2, 1) @ vectors[:, :, None])[:, :, 0]
    known = sizes > 1e-9 * sizes[:, 1:]
    squares = np.where(known, along**2 / np.where(known, sizes, 1), 0)
    return np.sqrt(squares.sum(axis=1))
