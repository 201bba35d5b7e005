"""Why a scan cannot be registered: its shape, its units, its handedness, or single targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.base.text import counted, listed
from ahf_ros.clouds.registration.rigid import Fit, fit
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import entries
from ahf_ros.network.similarity import similarity_between

NARROW = 0.03
"""Smallest accepted width of a field of targets across its length, relative to this."""

_OTHER_SCALE = 1.2  # or its inverse: beyond what a wrong ID does to the median distance
_SAME_PLACE = 0.05  # distance from the place of another target, relative to the movement
_MIRROR = np.diag([1.0, 1.0, -1.0])


def check_shape(names: Sequence[str], points: FloatArray, where: str) -> None:
    """Refuse fewer than three points (n, 3), or points nearly on a line."""
    if len(points) < 3:
        raise ValueError(
            f'{where} has {counted(len(points), "target")}, accepted are three or more'
        )
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
    if sizes[1] < NARROW * sizes[0]:
        length, width = np.ptp(points @ axes[:2].T, axis=0)
        raise ValueError(
            f'targets {listed(names)} are nearly on a line: {length:.3g} m long and '
            f'{width:.3g} m wide in {where}; the rotation about it is not determined'
        )


@dataclass(frozen=True)
class Match:
    """Targets in common: points (n, 3) of the scan, and `aim` (n, 3) of the field.

    Their covariances are `own`, (n, 3, 3), and `theirs`, (3n, 3n).
    """

    names: tuple[str, ...]
    points: FloatArray
    own: FloatArray
    aim: FloatArray
    theirs: FloatArray

    def fitted(self, rows: Sequence[int] | None = None) -> Fit:
        """Return the transform of all targets, or of some."""
        rows = range(len(self.names)) if rows is None else rows
        chosen, some = entries(rows), list(rows)
        theirs = self.theirs[np.ix_(chosen, chosen)]
        return fit(self.points[some], self.own[some], self.aim[some], theirs)

    def changed(self, movement: FloatArray) -> Match:
        """Return the match after a linear movement (3, 3) of the scan."""
        own = movement @ self.own @ movement.T
        return replace(self, points=self.points @ movement.T, own=own)


def checked_fit(match: Match, names: Sequence[str], points: FloatArray) -> Fit:
    """Return the transform of a match, or raise a ValueError that says why none fits.

    The whole field has the names (m,) and points (m, 3), where the places of wrong IDs may be.
    """
    check_shape(match.names, match.aim, 'the field')
    check_shape(match.names, match.points, 'the scan')
    ratio = _ratio(match.points, match.aim)
    if not 1 / _OTHER_SCALE < ratio < _OTHER_SCALE:
        raise ValueError(_of_scale(ratio))
    best = match.fitted()
    if best.plausible:
        return best
    if match.changed(_MIRROR).fitted().plausible:
        raise ValueError(
            'the scan is a mirror image of the field, accepted are frames of the same hand'
        )
    kept = _consistent(match)
    if kept:
        raise ValueError(_of_targets(match, kept, names, points))
    scale = similarity_between(match.points, match.aim).scale
    if match.changed(scale * np.eye(3)).fitted().plausible:
        raise ValueError(_of_scale(scale))
    largest = np.linalg.norm(best.residuals, axis=1).max()
    raise ValueError(
        f'targets {listed(match.names)} do not fit: residuals are up to {largest:.3g} m, and '
        'which of them moved or have a wrong ID cannot be told'
    )


def _ratio(points: FloatArray, aim: FloatArray) -> float:
    """Return the median ratio of distances in the field to those in the scan."""
    first, second = np.triu_indices(len(points), 1)
    lengths, others = (np.linalg.norm(it[first] - it[second], axis=1) for it in (points, aim))
    return float(np.median(others / np.maximum(lengths, np.finfo(float).tiny)))


def _of_scale(ratio: float) -> str:
    words = f'targets are {1 / ratio:.4g} times as far apart in the scan as in the field'
    for factor, scan, other in ((1e-3, 'millimetres', 'metres'), (1e3, 'metres', 'millimetres')):
        if abs(np.log(ratio / factor)) < np.log(_OTHER_SCALE):
            return f'{words}: the scan is in {scan}, the field in {other}; accepted are metres'
    return f'{words}, accepted is the same scale'


def _consistent(match: Match) -> list[int]:
    """Return the rows of targets that fit together, leaving out one after the other.

    They are none unless four targets are in common and the choice is unique.
    """
    kept = list(range(len(match.names)))
    while not match.fitted(kept).plausible:
        if len(kept) == 3:
            return []
        rest = [match.fitted([row for row in kept if row != out]) for out in kept]
        order = np.argsort([it.cost for it in rest])
        if len(kept) == 4 and rest[order[1]].plausible:
            return []
        del kept[order[0]]
    if len(kept) == 3 and len(match.names) > 4:
        return []  # three of many fit by chance
    for row in range(len(match.names)):
        # One may have been left out because of another.
        if row not in kept and match.fitted(sorted([*kept, row])).plausible:
            kept = sorted([*kept, row])
    return kept


def _of_targets(
    match: Match, kept: Sequence[int], names: Sequence[str], points: FloatArray
) -> str:
    """Return which targets do not fit to those kept, and whether each moved or has a wrong ID."""
    places = match.fitted(kept).transform.moved(match.points)
    remarks = []
    for row, name in enumerate(match.names):
        if row in kept:
            continue
        moved = np.linalg.norm(places[row] - match.aim[row])
        away = np.linalg.norm(points - places[row], axis=1)
        nearest = int(away.argmin())
        if names[nearest] != name and away[nearest] < _SAME_PLACE * moved:
            remarks.append(f'target {name} is where {names[nearest]} was: a wrong ID')
        else:
            remarks.append(f'target {name} moved by {moved:.3g} m or has a wrong ID')
    fitting = listed([match.names[row] for row in kept])
    return f'{"; ".join(remarks)}; {fitting} fit to each other'
