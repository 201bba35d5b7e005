"""Self-calibration: which parameters of a camera a network determines.

Parameters are released in stages [1]_. Those stay that are not correlated with others so much that
neither means anything alone [2]_, and in the end those that differ significantly from what they
were.

References
----------
.. [1] Luhmann et al., Close-Range Photogrammetry and 3D Imaging, 3rd ed. 2020, 7.3.
.. [2] Fraser, Digital camera self-calibration, ISPRS J. 52 (4), 1997, 149-159.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation.camera import PARAMETERS, pinhole
from ahf_ros.orientation.network import FloatArray, Network
from ahf_ros.orientation.solution import Start

STAGES = (('f',), ('k1',), ('cx', 'cy'), ('k2', 'p1', 'p2'), ('k3',), ('affinity', 'shear'))

_SIGNIFICANT = 2.576  # standard deviations; 1 % error probability
_CORRELATED = 0.95
_FOCAL_LENGTH = 0.03  # standard deviation over the focal length that says nothing of it
_ROLLED = np.deg2rad(60)  # between photographs that separate the principal point from poses
_FACING = 0.5  # cosine between the axes of photographs whose roll is compared
_COMPARED = 100  # photographs of a camera whose roll is compared, spread evenly

_RADIAL = [PARAMETERS.index(name) for name in ('k1', 'k2', 'k3')]
_UNDETERMINED = (
    'camera {}: these photographs do not determine the focal length, it stays as it was; take '
    'some tilted by 30 to 45 degrees against each other, or give a calibration'
)

Mask = NDArray[np.bool_]
Fit = Callable[[Mask, Start], tuple[Start, tuple[FloatArray, ...]]]
"""Adjusts with free parameters (cameras, parameters): values and covariances of calibrations."""


def released(network: Network, start: Start, fit: Fit) -> tuple[Mask, Start, tuple[str, ...]]:
    """Return the free parameters (cameras, parameters), values to begin with, and warnings.

    The focal length is released where its standard deviation is below 3 % of it, the principal
    point only where photographs are rolled. What is not significant is found at the end, since a
    parameter may be so only beside others.
    """
    free = np.zeros((len(network.cameras), len(PARAMETERS)), dtype=bool)
    state, warnings = start, []
    before = _known(network, start)
    open_cameras = [place for place, view in enumerate(network.cameras) if not view.fixed]
    for stage in (*STAGES, ()):
        trial = free.copy()
        for place in open_cameras:
            if stage != ('cx', 'cy') or rolled(start.rotations[network.camera_of == place]):
                trial[place, [PARAMETERS.index(name) for name in stage]] = True
        if stage and (trial == free).all():
            continue
        fitted, covariances = fit(trial, state)
        free = trial.copy()
        for place in open_cameras:
            change = fitted.calibrations[place] - before[place]
            if stage == ('f',):
                sigma = np.sqrt(covariances[place][0, 0])
                free[place, 0] = sigma < _FOCAL_LENGTH * fitted.calibrations[place, 0]
                if not free[place, 0]:
                    warnings.append(_UNDETERMINED.format(network.cameras[place].name))
            free[place] = _apart(change, covariances[place], free[place], significant=not stage)
        if (free == trial).all():
            state = fitted
    kept = np.where(free, state.calibrations, before)
    return free, replace(state, calibrations=kept), tuple(warnings)


def _known(network: Network, start: Start) -> FloatArray:
    """Return calibrations as they were known; approximate values of a lens are not knowledge."""
    return np.array(
        [
            pinhole(found[0], view.width, view.height)
            if view.calibration is None
            else view.calibration
            for view, found in zip(network.cameras, start.calibrations, strict=True)
        ]
    )


def rolled(rotations: FloatArray) -> bool:
    """Return whether photographs (n, 3, 3) that look alike are rolled by 60 degrees or more."""
    finite = rotations[np.isfinite(rotations).all(axis=(1, 2))]
    if len(finite) < 2:
        return False
    some = finite[np.unique(np.linspace(0, len(finite) - 1, _COMPARED).astype(int))]
    relative = np.einsum('aij,bkj->abik', some, some)
    roll = np.arctan2(
        relative[..., 1, 0] - relative[..., 0, 1], relative[..., 0, 0] + relative[..., 1, 1]
    )
    return bool(((relative[..., 2, 2] > _FACING) & (np.abs(roll) > _ROLLED)).any())


def _apart(change: FloatArray, covariance: FloatArray, free: Mask, significant: bool) -> Mask:
    """Return which free parameters (10,) stay: those that mean something beside each other.

    Of two that are too much correlated, that of less significance goes, and if asked for all that
    are not significant go, the least significant first. The others change as if it had been kept
    fixed. The radial parameters are coefficients of one polynomial: their correlation means
    nothing.
    """
    free = free.copy()
    while True:
        places = np.flatnonzero(free)
        sigma = np.sqrt(np.diag(covariance)[places])
        size = np.abs(change[places]) / sigma
        size[places == 0] = np.inf  # a focal length of zero is no hypothesis
        correlation = np.abs(covariance[np.ix_(places, places)] / np.outer(sigma, sigma))
        radial = np.isin(places, _RADIAL)
        correlation[np.outer(radial, radial) | np.eye(len(places), dtype=bool)] = 0
        involved = correlation.max(axis=0, initial=0) > _CORRELATED
        weak = involved | (significant & (size < _SIGNIFICANT))
        weak[places == 0] = False
        if not weak.any():
            return free
        left = places[np.argmin(np.where(weak, size, np.inf))]
        gain = covariance[:, left] / covariance[left, left]
        change = change - gain * change[left]
        covariance = covariance - np.outer(gain, covariance[left])
        free[left] = False
