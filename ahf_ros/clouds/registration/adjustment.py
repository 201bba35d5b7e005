"""Joint adjustment of all scans and targets, which closes the chain.

Unknown are the poses of the scans and the coordinates of the targets. Observed are the targets in
the frame of each scan, and the coordinates known before any scan. Where there are none, the first
scan holds the frame. Gauss-Newton steps solve for all at once, so that all have their covariance.
"""

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.clouds.registration.field import Field, RegisteredScan
from ahf_ros.clouds.registration.rigid import chi_square_limit
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.network.network import FloatArray, IntArray
from ahf_ros.network.points import entries
from ahf_ros.network.transform import Transform

_ROUNDS = 30
_CONVERGED = 1e-10  # decrease of the sum of weighted squares that a step promises


@dataclass(frozen=True)
class Adjusted:
    """A field after the adjustment, the sum of weighted squares, and its redundancy."""

    field: Field
    cost: float
    redundancy: int

    @property
    def sigma0(self) -> float:
        """Square root of the variance of unit weight; 1 without redundancy."""
        return float(np.sqrt(self.cost / self.redundancy)) if self.redundancy else 1.0

    def words(self) -> str:
        """Return in a sentence how well everything fits."""
        targets = counted(len(self.field.names), 'target')
        text = f'{counted(len(self.field.scans), "scan")} and {targets} adjusted, '
        text += f'sigma0 {self.sigma0:.2f}'
        if self.cost <= chi_square_limit(self.redundancy) or not self.redundancy:
            return text
        worst = max(
            (
                (float(np.linalg.norm(residual)), name, number)
                for number, scan in enumerate(self.field.scans, start=1)
                for name, residual in zip(scan.common, scan.residuals, strict=True)
            ),
            default=(0.0, '', 0),
        )
        return (
            f'{text}: residuals are larger than the covariances say, the largest is '
            f'{worst[0]:.3g} m at target {worst[1]} in scan {worst[2]}'
        )


def adjusted(field: Field) -> Adjusted:
    """Return the field after a joint adjustment of all its scans and targets.

    A ValueError says so if there are fewer than two scans, or the adjustment does not converge.
    """
    if len(field.scans) < 2 - bool(field.known):
        raise ValueError(
            f'{counted(len(field.scans), "scan")} registered, accepted are two or more, or one '
            'and known coordinates'
        )
    problem = _Problem(field)
    transforms = [it.transform for it in field.scans]
    points = field.points
    for _ in range(_ROUNDS):
        normal, right, cost = problem.equations(transforms, points)
        scale = 1 / np.sqrt(np.diag(normal))
        covariance = np.linalg.inv(scale[:, None] * normal * scale) * scale[:, None] * scale
        step = covariance @ right
        transforms, points = problem.stepped(transforms, points, step)
        if step @ right < _CONVERGED * (1 + cost):
            break
    else:
        raise ValueError('the adjustment does not converge; undo what was registered last')
    cost = problem.equations(transforms, points)[2]
    return Adjusted(
        problem.field(transforms, points, covariance), cost, problem.observations - len(step)
    )


class _Problem:
    """Observations of a field, ordered by scans, and where their unknowns are.

    The unknowns are t and b of each scan, but for the first one if it holds the frame, then the
    coordinates of the targets.
    """

    def __init__(self, field: Field) -> None:
        self._before = field
        self._held = 0 if field.known else 1
        scans = [it.scan for it in field.scans]
        self._counts = [len(it.names) for it in scans]
        self._targets = np.concatenate([field.rows(it.names) for it in scans])
        self._poses = 6 * (len(scans) - self._held)
        self._unknowns = self._poses + 3 * len(field.names)
        self._columns = np.concatenate((self._of_poses(scans), self._of_points()), axis=1)
        start = field.start
        self._known = entries(np.arange(field.known))
        self._information = np.linalg.inv(start.covariance) if field.known else np.zeros((0, 0))
        self.observations = 3 * len(self._targets) + 3 * field.known

    def _of_poses(self, scans: list[Scan]) -> IntArray:
        """Return the columns (m, 6) of the pose of each observation; a held one has the last."""
        numbers = np.repeat(np.arange(len(scans)), self._counts) - self._held
        columns = 6 * numbers[:, None] + np.arange(6)
        return np.where(numbers[:, None] < 0, self._unknowns, columns)

    def _of_points(self) -> IntArray:
        return self._poses + 3 * self._targets[:, None] + np.arange(3)

    def equations(
        self, transforms: list[Transform], points: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return normal matrix (u, u), right side (u,) and sum of weighted squares."""
        scans = [it.scan for it in self._before.scans]
        pairs = list(zip(scans, transforms, strict=True))
        moved = np.concatenate([transform.moved(scan.points) for scan, transform in pairs])
        design = np.zeros((len(moved), 3, 9))
        design[:, :, :6] = np.concatenate([it.changes(scan.points) for scan, it in pairs])
        design[:, :, 6:] = -np.eye(3)
        weights = np.linalg.inv(
            np.concatenate([it.turned(scan.covariances) for scan, it in pairs])
        )
        residuals = points[self._targets] - moved
        weighted = design.transpose(0, 2, 1) @ weights
        size = self._unknowns + 1
        normal, right = np.zeros((size, size)), np.zeros(size)
        columns = self._columns
        np.add.at(normal, (columns[:, :, None], columns[:, None, :]), weighted @ design)
        np.add.at(right, columns, (weighted @ residuals[:, :, None])[:, :, 0])
        cost = float(np.einsum('ia,iab,ib->', residuals, weights, residuals))
        given = self._before.start.points - points[: self._before.known]
        own = self._poses + self._known
        normal[np.ix_(own, own)] += self._information
        right[own] += self._information @ given.ravel()
        cost += float(given.ravel() @ self._information @ given.ravel())
        return normal[:-1, :-1], right[:-1], cost

    def stepped(
        self, transforms: list[Transform], points: FloatArray, step: FloatArray
    ) -> tuple[list[Transform], FloatArray]:
        """Return poses and points after a step (u,)."""
        steps = step[: self._poses].reshape(-1, 6)
        changed = [
            it.stepped(own) for it, own in zip(transforms[self._held :], steps, strict=True)
        ]
        return transforms[: self._held] + changed, points + step[self._poses :].reshape(-1, 3)

    def field(
        self, transforms: list[Transform], points: FloatArray, covariance: FloatArray
    ) -> Field:
        """Return the field of adjusted values."""
        blocks = [np.zeros((6, 6))] * self._held
        blocks += [covariance[at : at + 6, at : at + 6] for at in range(0, self._poses, 6)]
        scans = []
        for before, transform, own in zip(self._before.scans, transforms, blocks, strict=True):
            scan = before.scan
            residuals = points[self._before.rows(scan.names)] - transform.moved(scan.points)
            scans.append(
                RegisteredScan(
                    scan,
                    replace(transform, covariance=own),
                    scan.names,
                    residuals,
                    _cost(residuals, transform.turned(scan.covariances)),
                )
            )
        return replace(
            self._before,
            points=points,
            covariance=covariance[self._poses :, self._poses :],
            scans=tuple(scans),
        )


def _cost(residuals: FloatArray, covariances: FloatArray) -> float:
    return float((residuals * np.linalg.solve(covariances, residuals[..., None])[..., 0]).sum())
