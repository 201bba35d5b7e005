"""Points with their whole covariance: what an adjustment hands to measuring and comparing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.network.network import FloatArray, IntArray

_ASYMMETRY = 1e-6  # of the largest entry, that rounding in a file may leave
_NEGATIVE = 1e-6  # of the largest eigenvalue, the same


def blocks(covariance: FloatArray) -> FloatArray:
    """Return the covariance (n, 3, 3) of each point from that of all, (3n, 3n)."""
    count = len(covariance) // 3
    each = np.arange(count)
    return covariance.reshape(count, 3, count, 3)[each, :, each]


def standard_deviations(covariance: FloatArray) -> FloatArray:
    """Return the square roots of the diagonal, where rounding may leave less than zero."""
    return np.sqrt(np.maximum(np.diag(covariance), 0))


def correlations(covariance: FloatArray) -> FloatArray:
    """Return correlations, those of parameters that were kept fixed as 0."""
    sigma = standard_deviations(covariance)
    free = np.where(sigma > 0, sigma, 1)
    return np.where(np.eye(len(sigma), dtype=bool), 1, covariance / np.multiply.outer(free, free))


def entries(rows: Sequence[int] | IntArray) -> IntArray:
    """Return the rows of coordinates, (3n,), of the rows of points."""
    return np.ravel(3 * np.asarray(rows, np.int64)[:, None] + np.arange(3))


@dataclass(frozen=True)
class MeasuredPoints:
    """Coordinates of targets by name, in one frame, with the covariance of all of them.

    `xyz` is (n, 3) and `covariance` (3n, 3n), in `unit` and its square, ordered x, y, z of the
    first point, then of the next. The unit is empty where nothing gives a scale. `sigma0` is the
    square root of the variance of unit weight and `redundancy` its degrees of freedom;
    `scaled` says whether the covariance is multiplied by the square of `sigma0`. A ValueError
    names what does not fit together.
    """

    names: tuple[str, ...]
    xyz: FloatArray
    covariance: FloatArray
    sigma0: float = 1.0
    redundancy: int = 0
    unit: str = ''
    scaled: bool = False

    def __post_init__(self) -> None:
        """Check names, shapes, numbers and that the covariance is one."""
        count = len(self.names)
        if len(set(self.names)) < count:
            twice = next(it for it in self.names if self.names.count(it) > 1)
            raise ValueError(f'names have {twice!r} twice, accepted is each name once')
        _check_array('xyz', self.xyz, (count, 3))
        _check_array('covariance', self.covariance, (3 * count, 3 * count))
        if not (np.isfinite(self.sigma0) and self.sigma0 > 0):
            raise ValueError(f'sigma0 is {self.sigma0}, accepted is a positive number')
        if self.redundancy < 0:
            raise ValueError(f'redundancy is {self.redundancy}, accepted is 0 or more')
        if not count:
            return
        largest = np.abs(self.covariance).max()
        if np.abs(self.covariance - self.covariance.T).max() > _ASYMMETRY * largest:
            raise ValueError('covariance is not symmetric, accepted is a covariance matrix')
        eigenvalues = np.linalg.eigvalsh(self.covariance)
        if eigenvalues[0] < -_NEGATIVE * eigenvalues[-1]:
            raise ValueError(
                f'covariance has the eigenvalue {eigenvalues[0]:.3g}, accepted is none below 0'
            )

    @property
    def cofactors(self) -> FloatArray:
        """The covariance for a variance of unit weight of one."""
        return self.covariance / self.sigma0**2 if self.scaled else self.covariance

    def indices(self, names: Sequence[str]) -> list[int]:
        """Return the places of points; a ValueError names those that are not there."""
        places = {name: place for place, name in enumerate(self.names)}
        if missing := [name for name in names if name not in places]:
            raise ValueError(f'targets {", ".join(missing)} are not among the measured ones')
        return [places[name] for name in names]

    def chosen(self, names: Sequence[str]) -> MeasuredPoints:
        """Return some of the points, in the order of their names."""
        rows = self.indices(names)
        some = entries(rows)
        covariance = self.covariance[np.ix_(some, some)]
        return replace(self, names=tuple(names), xyz=self.xyz[rows], covariance=covariance)


def _check_array(name: str, array: FloatArray, shape: tuple[int, ...]) -> None:
    if np.shape(array) != shape:
        raise ValueError(f'{name} has the shape {np.shape(array)}, accepted is {shape}')
    if wrong := int((~np.isfinite(array)).sum()):
        raise ValueError(f'{name} has {wrong} entries that are no numbers, accepted is none')
