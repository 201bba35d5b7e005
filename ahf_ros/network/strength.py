"""How strong the geometry of a network is, and what to photograph next where it is weak."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ahf_ros.base.text import counted, listed
from ahf_ros.network.calibration import rolled
from ahf_ros.network.network import FloatArray, IntArray
from ahf_ros.network.solution import Solution
from ahf_ros.network.views import largest_angles

FEW_RAYS = 3
"""Number of rays with which a wrong one is noticed but cannot be named."""

SMALL_ANGLE = math.radians(30)
"""Angle between the outermost rays below which depth is much less certain than the rest."""

NO_CHECKS = 'no checks'
"""Weakness of a network whose scale nothing checks."""

_FEW_POINTS = 6  # observations, with which a pose has hardly a check
_COVERED = 0.7  # of the half diagonal, that observations should reach
_NAMED = 3  # cameras in a sentence
_WEAK = 3.0  # times the median, of the largest standard deviation of a target


def rays_of(solution: Solution) -> IntArray:
    """Return the number of observations of each target that the adjustment used."""
    used = solution.network.observations.point[solution.state.used]
    return np.bincount(used, minlength=len(solution.network.targets)).astype(np.int64)


def semi_axes(solution: Solution) -> FloatArray:
    """Return the standard deviations along the axes of each target's ellipsoid, largest first."""
    own = solution.point_covariances
    axes = np.full((len(own), 3), np.nan)
    known = np.isfinite(own).all(axis=(1, 2))
    axes[known] = np.sqrt(np.maximum(np.linalg.eigvalsh(own[known]), 0))[:, ::-1]
    return axes


class Weakness(NamedTuple):
    """What is weak, in few words, and a sentence on what would make it stronger."""

    what: str
    remedy: str


def weaknesses(solution: Solution) -> list[Weakness]:
    """Return what is weak in the geometry of a network, and what to photograph next."""
    return [
        *_of_targets(solution),
        *_of_photographs(solution),
        *_of_cameras(solution),
        *_of_scale(solution),
    ]


def _of_targets(solution: Solution) -> Iterator[Weakness]:
    network = solution.network
    known = solution.determined
    angles = largest_angles(network, solution.state)
    rays, largest = rays_of(solution), semi_axes(solution)[:, 0]
    found = known & ~(largest == 0)  # the others were given, and need no rays

    def number(chosen: np.ndarray) -> str:
        return counted(int(chosen.sum()), 'target')

    if np.any(few := found & (rays < FEW_RAYS)):
        yield Weakness(
            f'{number(few)} with two rays',
            f'Photograph {_named(network.targets, few)} again, from another side: two rays only, '
            'so that a wrong ID is not noticed.',
        )
    if np.any(flat := found & (angles < SMALL_ANGLE)):
        yield Weakness(
            f'{number(flat)} with all rays within {math.degrees(SMALL_ANGLE):g} degrees',
            f'Photograph {_named(network.targets, flat)} from further to the side: all rays are '
            f'within {math.degrees(SMALL_ANGLE):g} degrees, so that the depth is uncertain.',
        )
    typical = float(np.median(largest[found])) if found.any() else math.nan
    weak = found & (largest > _WEAK * typical) & ~few & ~flat
    if np.any(weak):
        yield Weakness(
            f'{number(weak)} with {_WEAK:g} times the usual standard deviation',
            f'Photograph {_named(network.targets, weak)} more often: the standard deviation is '
            f'above {_WEAK:g} times the usual one.',
        )
    if np.any(~known):
        yield Weakness(
            f'{number(~known)} without coordinates',
            f'Photograph {_named(network.targets, ~known)} from two sides or more: no '
            'coordinates.',
        )


def _of_photographs(solution: Solution) -> Iterator[Weakness]:
    network, values = solution.network, solution.state
    posed = solution.oriented
    number = np.bincount(
        network.observations.photograph[values.used], minlength=len(network.photographs)
    )
    if np.any(~posed):
        yield Weakness(
            f'{counted(int(np.sum(~posed)), "photograph")} without a pose',
            f'{_named(network.photographs, ~posed)}: no pose. Take photographs in between that '
            'show six or more of the same targets as others.',
        )
    if np.any(few := posed & (number < _FEW_POINTS)):
        yield Weakness(
            f'{counted(int(few.sum()), "photograph")} with fewer than {_FEW_POINTS} targets',
            f'{_named(network.photographs, few)}: fewer than {_FEW_POINTS} targets. Step back, or '
            'add targets.',
        )


def _of_cameras(solution: Solution) -> Iterator[Weakness]:
    """Yield what would determine the calibrations better."""
    network, values = solution.network, solution.state
    flat, empty, least = list[str](), list[str](), 1.0
    for place, view in enumerate(network.cameras):
        taken = (network.camera_of == place) & solution.oriented
        if view.fixed or not taken.any():
            continue
        if not rolled(values.rotations[taken]):
            flat.append(view.name)
        seen = taken[network.observations.photograph] & values.used
        centre = (np.array([view.width, view.height]) - 1) / 2
        reached = np.linalg.norm(network.observations.xy[seen] - centre, axis=1)
        share = float(np.quantile(reached, 0.98) / np.linalg.norm(centre)) if seen.any() else 0.0
        if share < _COVERED:
            empty.append(view.name)
            least = min(least, share)
    if flat:
        yield Weakness(
            f'no photograph of {_cameras(flat)} is rolled',
            f'C{_cameras(flat)[1:]}: no photograph is rolled by 90 degrees about its '
            'axis. Roll some, so that the principal point can be determined.',
        )
    if empty:
        yield Weakness(
            f'no targets in the corners of {_cameras(empty)}',
            f'C{_cameras(empty)[1:]}: targets reach only {100 * least:.0f} % of the way '
            'to the corners. Fill the images, so that the distortion is known there, too.',
        )


def _cameras(names: Sequence[str]) -> str:
    return f'camera {names[0]}' if len(names) == 1 else f'cameras {listed(names, _NAMED)}'


def _of_scale(solution: Solution) -> Iterator[Weakness]:
    network = solution.network
    if not network.unit:
        yield Weakness('no scale', 'Add a scale bar or control points: the network has no scale.')
        return
    checks = [it.check for it in network.bars] + [it.check for it in network.control]
    if not any(checks) and (semi_axes(solution)[:, 0] > 0).any():
        yield Weakness(
            NO_CHECKS,
            'Keep a scale bar or a control point as a check (role check): nothing that was not '
            'used says how good the scale is.',
        )


def _named(names: Sequence[str], chosen: np.ndarray) -> str:
    return listed([name for name, one in zip(names, chosen, strict=True) if one])
