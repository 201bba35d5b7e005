"""What was computed: cameras, poses and points, with their covariances and what was left out.

Groups of photographs that do not hang together are solutions of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ahf_ros.base.deprecation import warn_of_name
from ahf_ros.network.network import FloatArray, Network, Rejection, part_of
from ahf_ros.network.points import MeasuredPoints, blocks, entries

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class NetworkState:
    """Values of a connected group of photographs, in any frame and scale, approximate or adjusted.

    Photographs and points that are not in the group are NaN.
    """

    calibrations: FloatArray
    """(cameras, parameters) in the order of `camera.PARAMETERS`."""
    rotations: FloatArray
    """(photographs, 3, 3) from world to camera: X_camera = R (X - position)."""
    positions: FloatArray
    """(photographs, 3) centres of projection."""
    points: FloatArray
    """(points, 3)."""
    used: NDArray[np.bool_]
    """(observations,) those that agree with these values."""


@dataclass(frozen=True)
class Suspect:
    """A bar or point that contradicts what else is known, or a check that fails.

    `gap` is how far it differs from what the rest says, `sigma` the standard deviation of that,
    `probability` how often chance alone makes one so large among as many. `rivals` are those of
    which one may be wrong instead.
    """

    name: str
    gap: float
    sigma: float
    probability: float
    verdict: Literal['left out', 'kept', 'unclear', 'failed']
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True)
class Solution:
    """An adjusted network; arrays as in `NetworkState`, NaN for what could not be determined.

    Covariances hold the a-priori weights, scaled by the square of `sigma0` where `scaled` says so.
    A pose's 6x6 covariance is of (position, rotation vector in the camera's frame, rad).
    """

    network: Network
    state: NetworkState
    residuals: FloatArray
    """(observations, 2) measured minus computed, px."""
    normalised: FloatArray
    """(observations,) residuals over their standard deviations, as the w-test sees them."""
    camera_covariances: tuple[FloatArray, ...]
    """One (parameters, parameters) a camera, zero for parameters that were kept fixed."""
    released: tuple[tuple[str, ...], ...]
    """Names of the parameters that were estimated, for each camera."""
    pose_covariances: FloatArray
    covariance_of_points: FloatArray
    """(3 points, 3 points), all of it."""
    sigma0: float
    redundancy: int
    rejected: tuple[Rejection, ...]
    warnings: tuple[str, ...]
    scaled: bool = False
    """Whether covariances are scaled: where the test of the variance of unit weight refuses 1."""
    backward: bool = False
    """Whether distortion is a correction at the measured place; see `camera`."""
    converged: bool = True
    suspects: tuple[Suspect, ...] = ()
    """Bars and points that contradict the rest, and checks that fail."""
    expected_rejections: float = 0.0
    """Image points that chance alone would reject."""

    def check_forward(self) -> None:
        """Raise a ValueError if its distortion is backward, which files do not tell apart."""
        if self.backward:
            raise ValueError(
                'backward is True, accepted is a solution with the forward distortion of '
                'OpenCV: adjust without backward to write it'
            )

    @property
    def start(self) -> NetworkState:
        """Former name of `state`."""
        warn_of_name('Solution', 'start', 'state')
        return self.state

    @property
    def oriented(self) -> NDArray[np.bool_]:
        """Which photographs have a pose, (photographs,)."""
        return np.asarray(np.isfinite(self.state.positions).all(axis=1))

    @property
    def determined(self) -> NDArray[np.bool_]:
        """Which targets have coordinates, (points,)."""
        return np.asarray(np.isfinite(self.state.points).all(axis=1))

    @property
    def calibrated(self) -> NDArray[np.bool_]:
        """Which cameras have a calibration, (cameras,): those that took oriented photographs."""
        return np.asarray(np.isfinite(self.state.calibrations).all(axis=1))

    @property
    def point_covariances(self) -> FloatArray:
        """(points, 3, 3), of each point by itself."""
        return blocks(self.covariance_of_points)

    @cached_property
    def measured_points(self) -> MeasuredPoints:
        """The targets that have coordinates, with their covariance."""
        rows = np.flatnonzero(self.determined)
        some = entries(rows)
        return MeasuredPoints(
            names=tuple(self.network.targets[row] for row in rows),
            xyz=self.state.points[rows],
            covariance=self.covariance_of_points[np.ix_(some, some)],
            sigma0=float(self.sigma0),
            redundancy=int(self.redundancy),
            unit=self.network.unit,
            scaled=self.scaled,
        )


def separated(solutions: Sequence[Solution]) -> list[Solution]:
    """Return the solutions of one network without what only other groups determine.

    What no group determines stays in the first one.
    """
    posed = np.array([it.oriented for it in solutions])
    placed = np.array([it.determined for it in solutions])
    parts = []
    for number, solution in enumerate(solutions):
        masks = []
        for known in (posed, placed):
            nowhere = ~known.any(axis=0) if number == 0 else False
            masks.append(np.asarray(known[number] | nowhere))
        parts.append(part(solution, *masks))
    return parts


def part(solution: Solution, photographs: Mask, targets: Mask) -> Solution:
    """Return a solution with some of its photographs and targets; cameras stay as they are."""
    start = solution.state
    network, rows = part_of(solution.network, np.flatnonzero(photographs), np.flatnonzero(targets))
    if not network.bars and not network.control:
        network = replace(network, unit='')
    entries = np.repeat(targets, 3)
    return replace(
        solution,
        network=network,
        state=replace(
            start,
            rotations=start.rotations[photographs],
            positions=start.positions[photographs],
            points=start.points[targets],
            used=start.used[rows],
        ),
        residuals=solution.residuals[rows],
        normalised=solution.normalised[rows],
        pose_covariances=solution.pose_covariances[photographs],
        covariance_of_points=solution.covariance_of_points[np.ix_(entries, entries)],
        rejected=tuple(it for it in solution.rejected if it.photograph in network.photographs),
    )


def __getattr__(name: str) -> Any:
    """Return what had another name until the last release."""
    if name != 'Start':
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    warn_of_name(__name__, name, 'NetworkState')
    return NetworkState
