"""What registration needs of a scan: its targets, with their covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.base.text import shown
from ahf_ros.network.network import FloatArray, IntArray


@dataclass(frozen=True)
class Scan:
    """Targets of a scan in the frame of its scanner.

    Each has a name, a point of `points` (n, 3), m, and its covariance of `covariances` (n, 3, 3),
    m^2. A ValueError names what is not accepted.
    """

    names: tuple[str, ...]
    points: FloatArray
    covariances: FloatArray

    def __post_init__(self) -> None:
        """Check names, shapes, numbers and covariances."""
        count = len(self.names)
        for name, array, shape in (
            ('points', self.points, (count, 3)),
            ('covariances', self.covariances, (count, 3, 3)),
        ):
            if array.shape != shape:
                raise ValueError(f'{name} have the shape {array.shape}, accepted is {shape}')
        for number, name in enumerate(self.names):
            if name in self.names[:number]:
                raise ValueError(f'target {shown(name)} is there twice, accepted is once')
            if not np.isfinite(self.points[number]).all():
                raise ValueError(
                    f'point of target {shown(name)} is {self.points[number]}, accepted are three '
                    'finite numbers'
                )
            covariance = self.covariances[number]
            if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0):
                raise ValueError(
                    f'covariance of target {shown(name)} is {covariance.tolist()}, accepted is '
                    'one that is positive definite'
                )

    def rows(self, names: Sequence[str]) -> IntArray:
        """Return the rows of targets."""
        places = {name: row for row, name in enumerate(self.names)}
        return np.array([places[name] for name in names], np.int64)

    def without(self, names: Sequence[str]) -> Scan:
        """Return the scan without some of its targets."""
        rows = [row for row, name in enumerate(self.names) if name not in names]
        kept = tuple(self.names[row] for row in rows)
        return Scan(kept, self.points[rows], self.covariances[rows])


def block_diagonal(blocks: FloatArray) -> FloatArray:
    """Return the matrix (3n, 3n) with blocks (n, 3, 3) on its diagonal."""
    count = len(blocks)
    whole = np.zeros((count, 3, count, 3))
    each = np.arange(count)
    whole[each, :, each] = blocks
    return whole.reshape(3 * count, 3 * count)
