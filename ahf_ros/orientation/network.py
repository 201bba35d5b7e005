"""What was observed: image points of targets, and what is known of cameras, lengths and points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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


@dataclass(frozen=True)
class ControlPoint:
    """Known coordinates of a target, with their 3x3 covariance; a check point is not used.

    A covariance of zero fixes the point.
    """

    name: str
    xyz: FloatArray
    covariance: FloatArray
    check: bool = False


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
    set_aside: tuple[Rejection, ...] = field(default=())
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
    aside = tuple(
        Rejection(
            network.photographs[observed.photograph[row]],
            network.targets[observed.point[row]],
            (float(observed.xy[row, 0]), float(observed.xy[row, 1])),
            reason,
        )
        for row in np.flatnonzero(rows)
    )
    kept = observed.rows(~rows)
    return replace(network, observations=kept, set_aside=network.set_aside + aside)


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
