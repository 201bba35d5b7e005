"""The growing field of targets: scans are registered to it, and it grows by their other targets.

Coordinates of the field stay what they were at first sight until an adjustment: what was
published before stays valid. All of them are linear functions of what the scans measured, and so
have an exact covariance, with that between targets. A chain of scans loses precision as the
covariance says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros.clouds.registration.refusals import Match, check_shape, checked_fit
from ahf_ros.clouds.registration.scan import Scan, block_diagonal
from ahf_ros.network.network import FloatArray, IntArray
from ahf_ros.network.points import MeasuredPoints, blocks, entries
from ahf_ros.network.transform import Transform

_EXACT = 1e-6  # m, of known coordinates, beside their own precision


@dataclass(frozen=True)
class RegisteredScan:
    """A scan, its transform into the field, and the targets that this rests on.

    `residuals`, one (3,) for each of `common`, are coordinates of the field minus those of the
    scan, m, along the axes of the field. `cost` is the sum of their weighted squares.
    """

    scan: Scan
    transform: Transform
    common: tuple[str, ...] = ()
    residuals: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    cost: float = 0.0

    @property
    def rms(self) -> float:
        """Root mean square length of the residuals, m; 0 without any."""
        return float(np.sqrt((self.residuals**2).sum() / max(1, len(self.common))))


@dataclass(frozen=True)
class Field:
    """Targets in one frame: names, points (n, 3), m, and the covariance (3n, 3n) of all of them.

    The first `known` targets are those whose coordinates were known before any scan.
    """

    names: tuple[str, ...] = ()
    points: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    scans: tuple[RegisteredScan, ...] = ()
    known: int = 0
    origin: Field | None = None
    """The field before any scan; None if this is it."""

    def rows(self, names: Sequence[str]) -> IntArray:
        """Return the rows of targets."""
        places = {name: row for row, name in enumerate(self.names)}
        return np.array([places[name] for name in names], np.int64)

    @property
    def covariances(self) -> FloatArray:
        """Covariance of each target, (n, 3, 3)."""
        return blocks(self.covariance)

    @property
    def start(self) -> Field:
        """The field before any scan."""
        return self.origin or self


def known_field(points: MeasuredPoints | None) -> Field:
    """Return a field of known coordinates, m; without any, the first scan gives the frame.

    Each of them has a standard deviation of 1 micrometre more than is given, which may be zero.
    """
    if points is None:
        return Field()
    exact = _EXACT**2 * np.eye(points.xyz.size)
    count = len(points.names)
    return Field(points.names, points.xyz, points.covariance + exact, known=count)


def added(before: Field, scan: Scan) -> Field:
    """Return the field with another scan, the last of its `scans`.

    A ValueError says why the scan does not fit: fewer than three targets in common, nearly on a
    line, other units, a mirrored frame, or targets, by name, that moved or have a wrong ID.
    """
    if not before.names:
        check_shape(scan.names, scan.points, 'the scan')
        found = RegisteredScan(scan, Transform())
        return _grown(before, scan, found, np.zeros((6, 0)), ())
    common = tuple(name for name in scan.names if name in set(before.names))
    rows, places = scan.rows(common), before.rows(common)
    if len(common) < 3:
        own = ', '.join(scan.names) or 'none'
        raise ValueError(
            f'{len(common)} of the targets of the scan, {own}, are in the field, accepted are '
            'three or more'
        )
    chosen = entries(places)
    match = Match(
        common,
        scan.points[rows],
        scan.covariances[rows],
        before.points[places],
        before.covariance[np.ix_(chosen, chosen)],
    )
    best = checked_fit(match, before.names, before.points)
    found = RegisteredScan(scan, best.transform, common, best.residuals, best.cost)
    return _grown(before, scan, found, best.gain, common)


def _grown(
    before: Field, scan: Scan, found: RegisteredScan, gain: FloatArray, common: tuple[str, ...]
) -> Field:
    """Return the field with the targets of a scan that it does not have yet.

    With the error e of the residuals of the transform, (3c,), which is that of the field minus
    that of the scan, t and b are wrong by `gain` e, and new targets by J `gain` e and their own.
    """
    new = tuple(name for name in scan.names if name not in set(before.names))
    rows, transform = scan.rows(new), found.transform
    points = scan.points[rows]
    by_pose = transform.changes(points).reshape(-1, 6)
    own = block_diagonal(transform.turned(scan.covariances[rows]))
    own += by_pose @ transform.covariance @ by_pose.T
    shared = by_pose @ gain @ before.covariance[entries(before.rows(common))]
    return replace(
        before,
        names=before.names + new,
        points=np.concatenate((before.points, transform.moved(points))),
        covariance=np.block([[before.covariance, shared.T], [shared, own]]),
        scans=(*before.scans, found),
        origin=before.start,
    )
