"""The pose of one image from known targets and a known camera, or why it is not determined."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.base.text import counted, listed
from ahf_ros.network.camera import PARAMETERS, linearise, undistort
from ahf_ros.network.network import FloatArray, Rejection
from ahf_ros.network.planar import principal_axes
from ahf_ros.network.points import MeasuredPoints, entries
from ahf_ros.network.pose import Pose
from ahf_ros.network.pose_fit import (
    Fit,
    Mask,
    Sight,
    fitted,
    nearest,
    other_fit,
    residuals,
    tested_fit,
)
from ahf_ros.network.testing import CRITICAL
from ahf_ros.network.transform import Transform, camera_pose

FEWEST = 4
"""Targets that a pose needs: three leave up to four poses."""

UNLIKELY = 9.2
"""Chi-squares that differ by less leave another pose a probability of more than 1 %."""

TWICE = 'its ID is in this image twice'
NO_PLACE = 'the calibration of the lens does not reach its place'

_LINE = 0.05  # extent across a line, relative to that along it, of points that are nearly on it
_MOST_TURN = 0.1  # rad, and share of the distance: standard deviations of a pose that is none
_MISFIT = 0.02  # share of residuals of the extent of targets; wrong lenses have less
_CONTRADICTION = 1e-3  # probability of a sum of squares of four targets, which name no wrong one


@dataclass(frozen=True)
class NamedPlaces:
    """Targets by the names that their coordinates have, at places (n, 2) of the plane z = 1.

    `covariances` are (n, 2, 2). `aside` are those that were left out before.
    """

    names: tuple[str, ...]
    places: FloatArray
    covariances: FloatArray
    aside: tuple[Rejection, ...] = ()


@one_blas_thread()
def resect(
    targets: Sequence[Target],
    points: MeasuredPoints,
    calibration: ArrayLike,
    *,
    sigma: float = 0.1,
    equidistant: bool = False,
) -> Pose:
    """Return the pose of the camera of one image among targets of known coordinates.

    A space resection by weighted least squares [4]_. Targets with wrong IDs are found by Baarda's
    test [5]_, left out and named. A plane may have a second pose that fits as well [6]_.

    Parameters
    ----------
    targets : sequence of Target
        Of one image, as `identify` returns them. Those without an ID or without coordinates are
        not used.
    points : MeasuredPoints
        Coordinates with their covariance, as `read_network` and `orient` have them. They are named
        `family:ID` or by their IDs.
    calibration : array_like of float, shape (10,)
        Camera in the order of `ahf_ros.network.camera.PARAMETERS`, or of `EQUIDISTANT`.
    sigma : float
        Standard deviation of the centres that have no covariance, px.
    equidistant : bool
        Whether the lens is an equidistant fisheye one, as `OrientedNetwork.cameras` say.

    Returns
    -------
    Pose
        In the frame and the unit of the coordinates, with a covariance about the axes of their
        frame.

    Raises
    ------
    ValueError
        If the pose is not determined, with the reason: fewer than four targets that agree, targets
        on a line or nearly, or at a distance that says nothing; and if an argument is not
        accepted.

    References
    ----------
    .. [4] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, section 12.2.
    .. [5] Baarda, A testing procedure for use in geodetic networks, 1968.
    .. [6] Schweighofer & Pinz, IEEE Trans. PAMI 2006, 28, 2024.

    Examples
    --------
    >>> import numpy as np
    >>> from ahf_ros import Target, resect
    >>> from ahf_ros.network.camera import pinhole, project
    >>> from ahf_ros.network.points import MeasuredPoints
    >>> xyz = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.4]])
    >>> points = MeasuredPoints(('1', '2', '3', '4', '5'), xyz, np.zeros((15, 15)), unit='m')
    >>> camera = pinhole(1000.0, 1600, 1200)
    >>> looking_down = np.diag([1.0, -1.0, -1.0])
    >>> seen = project(camera, looking_down, np.array([0.4, 0.5, 2.5]), xyz)
    >>> targets = [Target(i + 1, 0, x, y, 5.0, 5.0) for i, (x, y) in enumerate(seen)]
    >>> pose = resect(targets, points, camera)
    >>> np.allclose(pose.camera.translation, (0.4, 0.5, 2.5)), pose.rejected
    (True, ())
    """
    lens = np.asarray(calibration, float)
    if lens.shape != (len(PARAMETERS),) or not np.isfinite(lens).all() or lens[0] <= 0:
        raise ValueError(
            f'calibration is {lens.tolist()}, accepted are {len(PARAMETERS)} finite numbers, '
            f'{", ".join(PARAMETERS)}, with f above 0'
        )
    names, chosen, aside = known_targets(targets, points.names)
    xy = np.array([(it.x, it.y) for it in chosen], float).reshape(-1, 2)
    places = undistort(lens, xy, equidistant=equidistant)
    ahead = np.column_stack((places, np.ones(len(places))))
    by_place = linearise(lens, np.eye(3), np.zeros(3), ahead, equidistant=equidistant).by_point[
        :, :, :2
    ]
    by_pixel = np.linalg.inv(np.where(np.isfinite(by_place), by_place, np.eye(2)))
    covariances = by_pixel @ centre_covariances(chosen, sigma) @ by_pixel.transpose(0, 2, 1)
    return pose_of(NamedPlaces(names, places, covariances, aside), points)


def known_targets(
    targets: Sequence[Target], known: Collection[str]
) -> tuple[tuple[str, ...], list[Target], tuple[Rejection, ...]]:
    """Return the names of targets that have coordinates, these targets, and what is set aside.

    A target has the name `family:ID`, or that of its ID where no coordinates have the former. An
    ID that is there twice is set aside.
    """
    own = set(known)
    labels = []
    for target in targets:
        names = (f'{target.family}:{target.id}', str(target.id))
        labels.append(next((it for it in names if it in own and target.id != UNDECODED), ''))
    count = Counter(filter(None, labels))
    both = list(zip(labels, targets, strict=True))
    kept = [(name, target) for name, target in both if count[name] == 1]
    aside = [Rejection('', name, (it.x, it.y), TWICE) for name, it in both if count[name] > 1]
    return tuple(name for name, _ in kept), [target for _, target in kept], tuple(aside)


def centre_covariances(targets: Sequence[Target], sigma: float) -> FloatArray:
    """Return the covariances (n, 2, 2) of centres, px²; that of `sigma` where there is none."""
    covariances = np.array([it.covariance for it in targets], float).reshape(-1, 2, 2)
    sizes = np.linalg.eigvalsh(np.where(np.isfinite(covariances), covariances, 0))
    unknown = ~(sizes[:, 0] > 1e-9 * sizes[:, 1]) | ~np.isfinite(covariances).all(axis=(1, 2))
    return np.where(unknown[:, None, None], sigma**2 * np.eye(2), covariances)


@one_blas_thread()
def pose_of(seen: NamedPlaces, points: MeasuredPoints) -> Pose:
    """Return the pose of one image of named points; a ValueError says why there is none."""
    try:
        return _determined(seen, points)
    except np.linalg.LinAlgError as error:
        raise ValueError(
            f'the targets {listed(seen.names)} do not determine the pose: {error}'
        ) from error


def _determined(seen: NamedPlaces, points: MeasuredPoints) -> Pose:
    """Return the pose; a ValueError says why there is none, or LinAlgError that it is singular."""
    seen = _reached(seen)
    if len(seen.names) < FEWEST:
        raise ValueError(
            f'{counted(len(seen.names), "target")} with known coordinates in the image, '
            f'{FEWEST} are needed{_but(seen.aside)}'
        )
    rows = np.array(points.indices(seen.names))
    some = entries(rows)
    sight = Sight(
        points.xyz[rows], seen.places, seen.covariances, points.covariance[np.ix_(some, some)]
    )
    across = _extents(sight.points)
    if across < 1e-3:
        raise ValueError(f'the {len(rows)} targets are on a line: the pose may turn about it')
    fit = tested_fit(sight)
    if fit is None:
        raise ValueError(
            f'there is no pose from which the {len(rows)} targets are seen before the camera: '
            'wrong coordinates, a mirrored frame, or wrong IDs'
        )
    scale = 1.0 if fit.plausible else fit.cost / fit.redundancy
    other = other_fit(sight, fit, UNLIKELY * scale)
    if other and other.cost < fit.cost:
        fit, other = fitted(sight, other.used, other.rotation, other.position) or other, fit
        scale = 1.0 if fit.plausible else fit.cost / fit.redundancy
    rest = residuals(sight, fit)
    _check_agreement(seen, fit, rest)
    camera = camera_pose(fit.rotation, fit.position, scale * fit.cofactors)
    _check_precision(sight, fit, camera)
    second = None
    if other:
        second = camera_pose(other.rotation, other.position, scale * other.cofactors)
    return Pose(
        camera=camera,
        second=second,
        targets=_names(seen, fit.used),
        residuals=rest,
        rejected=(*seen.aside, *_rejected(seen, sight, fit, points)),
        sigma0=float(np.sqrt(fit.cost / fit.redundancy)),
        redundancy=fit.redundancy,
    )


def _reached(seen: NamedPlaces) -> NamedPlaces:
    """Return the targets that have a place, and set the others aside."""
    finite = np.isfinite(seen.places).all(axis=1), np.isfinite(seen.covariances).all(axis=(1, 2))
    good = np.logical_and(*finite)
    if good.all():
        return seen
    lost = [
        Rejection('', name, (np.nan, np.nan), NO_PLACE)
        for name, reached in zip(seen.names, good, strict=True)
        if not reached
    ]
    return replace(
        seen,
        names=_names(seen, good),
        places=seen.places[good],
        covariances=seen.covariances[good],
        aside=(*seen.aside, *lost),
    )


def _check_agreement(seen: NamedPlaces, fit: Fit, rest: FloatArray) -> None:
    """Refuse a pose on which too few targets agree to tell wrong ones, or none really."""
    count, agree = len(fit.used), int(fit.used.sum())
    lengths = fit.lengths / fit.spread
    if agree == FEWEST and (count > agree or fit.by_chance < _CONTRADICTION):
        raise ValueError(
            f'the {count} targets {listed(seen.names)} contradict each other, and which one is '
            'wrong cannot be told: one more is needed'
        )
    if 2 * agree <= count or (lengths[fit.used] > CRITICAL).any():
        raise ValueError(
            f'{agree} of {count} targets agree with one pose, accepted are more than half of '
            'them: wrong coordinates or IDs, or another camera'
        )
    places = seen.places[fit.used]
    extent = float(np.linalg.norm(places - places.mean(axis=0)))
    share = float(np.linalg.norm(rest)) / max(extent, np.finfo(float).tiny)
    if share > _MISFIT:
        raise ValueError(
            f'residuals are {100 * share:.2g} % of the extent of the targets in the image, '
            f'accepted are {100 * _MISFIT:g} %: wrong coordinates, a mirrored frame, or another '
            'camera'
        )


def _check_precision(sight: Sight, fit: Fit, camera: Transform) -> None:
    """Refuse a pose whose errors are too large to be told from another one."""
    part = sight.points[fit.used]
    variances = (
        np.linalg.eigvalsh(camera.covariance[:3, :3])[-1:],
        np.linalg.eigvalsh(camera.covariance[3:, 3:])[-1:],
    )
    shift, turn = (float(np.sqrt(it[0])) for it in variances)
    distance = float(np.linalg.norm(part.mean(axis=0) - fit.position))
    if shift < _MOST_TURN * distance and turn < _MOST_TURN:
        return
    why = 'they are nearly on a line' if _extents(part) < _LINE else 'they are too near together'
    raise ValueError(
        f'the {len(part)} targets do not determine the pose, {why}: its standard deviations are '
        f'{np.degrees(turn):.2g} deg and {100 * shift / distance:.2g} % of the distance, accepted '
        f'are {np.degrees(_MOST_TURN):.2g} deg and {100 * _MOST_TURN:g} %'
    )


def _extents(points: FloatArray) -> float:
    """Return the extent of points across their line, relative to that along it."""
    spread, _ = principal_axes(points)
    return float(spread[1] / spread[0]) if spread[0] > 0 else 0.0


def _rejected(
    seen: NamedPlaces, sight: Sight, fit: Fit, points: MeasuredPoints
) -> list[Rejection]:
    """Return the targets that do not agree, and whose places they are at."""
    rejected = []
    for row in np.flatnonzero(~fit.used):
        found, length = nearest(sight, fit, int(row), points.xyz)
        reason = 'does not fit the other targets'
        if length < CRITICAL * fit.spread and points.names[found] != seen.names[row]:
            reason = f'wrong ID: the place of target {points.names[found]}'
        place = sight.places[row]
        rejected.append(
            Rejection(
                '',
                seen.names[row],
                (float(place[0]), float(place[1])),
                reason,
                float(fit.lengths[row] / fit.spread),
            )
        )
    return rejected


def _names(seen: NamedPlaces, of: Mask) -> tuple[str, ...]:
    return tuple(name for name, there in zip(seen.names, of, strict=True) if there)


def _but(aside: Sequence[Rejection]) -> str:
    """Return which targets were left out, and why, for the end of a message."""
    reasons = {it.reason: listed([other.target for other in aside]) for it in aside}
    return ''.join(f'; left out: {names}, {reason}' for reason, names in reasons.items())
