"""What was observed: image points of targets, and what is known of cameras, lengths and points.

Both are checked before anything is computed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


_SINGULAR = 1e-12  # smallest over largest variance of a place
_ROUNDING = 1e-9  # of covariances, relative to their largest entry


@dataclass(frozen=True)
class Observations:
    """Image points, one a row: photograph and point by index, place in px and its covariance.

    (0, 0) is the centre of the first pixel, x goes right and y down. `photograph` and `point` are
    (m,), `xy` is (m, 2) in px, `covariance` (m, 2, 2) in px².
    """

    photograph: IntArray
    point: IntArray
    xy: FloatArray
    covariance: FloatArray

    def rows(self, chosen: IntArray | NDArray[np.bool_]) -> Observations:
        """Return some of the observations, by index or mask."""
        return Observations(
            self.photograph[chosen], self.point[chosen], self.xy[chosen], self.covariance[chosen]
        )


@dataclass(frozen=True)
class ScaleBar:
    """A known distance between two targets in units of the object; a check bar is not used."""

    ends: tuple[str, str]
    length: float
    sigma: float
    check: bool = False

    @property
    def title(self) -> str:
        """What messages call it."""
        return f'scale bar {"-".join(self.ends)}'


@dataclass(frozen=True)
class ControlPoint:
    """Known coordinates of a target, with their 3x3 covariance; a check point is not used.

    A covariance of zero fixes the point.
    """

    name: str
    xyz: FloatArray
    covariance: FloatArray
    check: bool = False

    @property
    def title(self) -> str:
        """What messages call it."""
        return f'control point {self.name}'


@dataclass(frozen=True)
class CameraView:
    """A camera before the adjustment: its size in px, and its calibration where one is known."""

    name: str
    width: int
    height: int
    focal_length: float | None = None
    """Start value in px where no calibration is given; None where nothing is known."""
    calibration: FloatArray | None = None
    """All of `camera.PARAMETERS` where a calibration is given."""
    fixed: bool = False
    """Whether the calibration is kept as it is."""
    equidistant: bool = False
    """Whether its lens is an equidistant fisheye one; else it is Brown's."""


@dataclass(frozen=True)
class Network:
    """Photographs by name with the index of their cameras, targets by name, and what was observed.

    Names of targets are their IDs as text, `family:ID` where several families are there.
    """

    photographs: tuple[str, ...]
    camera_of: IntArray
    cameras: tuple[CameraView, ...]
    targets: tuple[str, ...]
    observations: Observations
    bars: tuple[ScaleBar, ...] = ()
    control: tuple[ControlPoint, ...] = ()
    unit: str = ''
    """Unit of bars and control, empty where neither gives a scale."""
    set_aside: tuple[Rejection, ...] = ()
    """Observations that were no part of the network from the start."""


@dataclass(frozen=True)
class Rejection:
    """An observation that is not used, and why; `xy` in px."""

    photograph: str
    target: str
    xy: tuple[float, float]
    reason: str
    normalised_residual: float | None = None


def once_a_photograph(network: Network) -> Network:
    """Return the network without targets that are twice in a photograph: both are set aside."""
    observed = network.observations
    key = observed.photograph * len(network.targets) + observed.point
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    return without(
        network, counts[inverse.ravel()] > 1, 'its ID is more than once in the photograph'
    )


def without(network: Network, rows: NDArray[np.bool_], reason: str) -> Network:
    """Return the network whose marked observations (m,) are set aside, for a reason."""
    observed = network.observations
    aside = tuple(rejected(network, int(row), reason) for row in np.flatnonzero(rows))
    kept = observed.rows(~rows)
    return replace(network, observations=kept, set_aside=network.set_aside + aside)


def rejected(network: Network, row: int, reason: str, length: float | None = None) -> Rejection:
    """Return that an observation is not used, and why; its residual has a normalised length."""
    observed = network.observations
    x, y = map(float, observed.xy[row])
    photograph = network.photographs[observed.photograph[row]]
    return Rejection(photograph, network.targets[observed.point[row]], (x, y), reason, length)


def part_of(
    network: Network, photographs: IntArray, targets: IntArray | None = None
) -> tuple[Network, IntArray]:
    """Return a network of some photographs and targets by index, and its rows of observations.

    Without `targets` it has all of them. Bars and control points stay whose targets are in it.
    """
    if targets is None:
        targets = np.arange(len(network.targets))
    image, target = (
        _places(chosen, len(names))
        for chosen, names in ((photographs, network.photographs), (targets, network.targets))
    )
    seen = network.observations
    rows = np.flatnonzero((image[seen.photograph] >= 0) & (target[seen.point] >= 0))
    some = seen.rows(rows)
    images = tuple(network.photographs[index] for index in photographs)
    names = tuple(network.targets[index] for index in targets)
    part = replace(
        network,
        photographs=images,
        camera_of=network.camera_of[photographs],
        targets=names,
        observations=replace(some, photograph=image[some.photograph], point=target[some.point]),
        bars=tuple(it for it in network.bars if set(names).issuperset(it.ends)),
        control=tuple(it for it in network.control if it.name in names),
        set_aside=tuple(it for it in network.set_aside if it.photograph in images),
    )
    return part, rows


def _places(chosen: IntArray, number: int) -> IntArray:
    """Return where each of a number of indices is among the chosen ones, -1 where it is not."""
    places = np.full(number, -1)
    places[chosen] = np.arange(len(chosen))
    return places


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
    network: Network, bad: NDArray[np.bool_], field: str, values: FloatArray, expected: str
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
