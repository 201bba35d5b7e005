"""Observations and knowledge are checked before anything is computed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation.network import FloatArray, Network

_SINGULAR = 1e-12  # smallest over largest variance of a place
_ROUNDING = 1e-9  # of covariances, relative to their largest entry


def check_network(network: Network) -> None:
    """Raise `ValueError` for observations, bars or control points that no adjustment can use."""
    seen = network.observations
    known = np.where(np.isfinite(seen.covariance), seen.covariance, 0)
    sizes = np.linalg.eigvalsh(known)
    largest = np.abs(sizes[:, 1])
    skew = np.abs(known[:, 0, 1] - known[:, 1, 0])
    key = seen.photograph * len(network.targets) + seen.point
    twice = np.ones(len(key), dtype=bool)
    twice[np.unique(key, return_index=True)[1]] = False
    finite, positive = 'finite numbers', 'symmetric positive definite px²'
    unusable = (skew > _ROUNDING * largest) | (sizes[:, 0] <= _SINGULAR * largest)
    for bad, field, values, expected in (
        (~np.isfinite(seen.xy).all(axis=1), 'xy', seen.xy, finite),
        (~np.isfinite(seen.covariance).all(axis=(1, 2)), 'covariance', seen.covariance, finite),
        (unusable, 'covariance', seen.covariance, positive),
        (twice, 'target', seen.xy, 'each target once in a photograph'),
    ):
        _refuse(network, np.asarray(bad), field, values, expected)
    for bar in network.bars:
        name = 'scale bar ' + '-'.join(bar.ends)
        if bar.ends[0] == bar.ends[1]:
            raise ValueError(f'{name}: both ends are one target, expected two')
        if not (np.isfinite(bar.length) and bar.length > 0):
            raise ValueError(f'{name}: length {bar.length}, expected a positive number')
        if not (np.isfinite(bar.sigma) and bar.sigma >= 0):
            raise ValueError(f'{name}: sigma {bar.sigma}, expected 0 or a positive number')
    for point in network.control:
        _check_control(point.name, point.xyz, point.covariance)
    names = [point.name for point in network.control if not point.check]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ValueError(f'control point {repeated[0]}: given twice, expected each target once')


def _check_control(name: str, xyz: FloatArray, covariance: FloatArray) -> None:
    if np.shape(xyz) != (3,) or not np.isfinite(xyz).all():
        raise ValueError(f'control point {name}: xyz {xyz}, expected three finite numbers')
    if np.shape(covariance) != (3, 3) or not np.isfinite(covariance).all():
        raise ValueError(f'control point {name}: covariance {covariance}, expected finite 3x3')
    largest = np.abs(covariance).max()
    if (np.abs(covariance - covariance.T) > _ROUNDING * largest).any() or (
        np.linalg.eigvalsh(covariance)[0] < -_ROUNDING * largest
    ):
        raise ValueError(
            f'control point {name}: covariance {covariance.tolist()}, expected a symmetric matrix '
            'without negative variances'
        )


def _refuse(
    network: Network,
    bad: NDArray[np.bool_],
    field: str,
    values: FloatArray,
    expected: str,
) -> None:
    """Raise `ValueError` that names the first bad observation and how many there are."""
    if not bad.any():
        return
    first = int(np.flatnonzero(bad)[0])
    photograph = network.photographs[network.observations.photograph[first]]
    target = network.targets[network.observations.point[first]]
    more = f', and {bad.sum() - 1} more' if bad.sum() > 1 else ''
    raise ValueError(
        f'{field} {values[first].tolist()} of target {target} in {photograph}{more}: '
        f'expected {expected}'
    )
