"""Self-calibration: which parameters of a camera a network determines.

Parameters are released in stages [1]_. Of each stage those stay that differ significantly from
what they were and are not correlated with others so much that neither means anything alone [2]_.

References
----------
.. [1] Luhmann et al., Close-Range Photogrammetry and 3D Imaging, 3rd ed. 2020, 7.3.
.. [2] Fraser, Digital camera self-calibration, ISPRS J. 52 (4), 1997, 149-159.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation.camera import PARAMETERS
from ahf_ros.orientation.network import FloatArray, Network
from ahf_ros.orientation.solution import Start

STAGES = (('f',), ('k1',), ('cx', 'cy'), ('k2', 'p1', 'p2'), ('k3',), ('affinity', 'shear'))

_SIGNIFICANT = 2.576  # standard deviations; 1 % error probability
_CORRELATED = 0.95
_FOCAL_LENGTH = 0.03  # standard deviation over the focal length that says nothing of it
_ROLLED = np.deg2rad(60)  # between photographs that separate the principal point from poses
_FACING = 0.5  # cosine between the axes of photographs whose roll is compared
_COMPARED = 100  # photographs of a camera whose roll is compared, spread evenly

Mask = NDArray[np.bool_]
Fit = Callable[[Mask, Start], tuple[Start, tuple[FloatArray, ...]]]
"""Adjusts with free parameters (cameras, parameters): values and covariances of calibrations."""


def released(network: Network, start: Start, fit: Fit) -> tuple[Mask, Start, tuple[str, ...]]:
    """Return the free parameters (cameras, parameters) stage by stage, the values, and warnings.

    The focal length is released where its standard deviation is below 3 % of it, the principal
    point only where photographs are rolled.
    """
    free = np.zeros((len(network.cameras), len(PARAMETERS)), dtype=bool)
    state, warnings = start, []
    open_cameras = [place for place, view in enumerate(network.cameras) if not view.fixed]
    for stage in STAGES:
        trial = free.copy()
        for place in open_cameras:
            if stage != ('cx', 'cy') or rolled(start.rotations[network.camera_of == place]):
                trial[place, [PARAMETERS.index(name) for name in stage]] = True
        while (trial & ~free).any():
            fitted, covariances = fit(trial, state)
            weak = _weak(trial & ~free, trial, fitted, state, covariances)
            if not weak:
                free, state = trial, fitted
                break
            for place, parameter in weak:
                trial[place, parameter] = False
                if parameter == 0:
                    warnings.append(
                        f'camera {network.cameras[place].name}: these photographs do not '
                        'determine the focal length, it stays as it was; take some tilted by 30 '
                        'to 45 degrees against each other, or give a calibration'
                    )
    return free, state, tuple(warnings)


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


def _weak(
    new: Mask, free: Mask, fitted: Start, before: Start, covariances: tuple[FloatArray, ...]
) -> list[tuple[int, int]]:
    """Return the new parameters to be left out, as pairs of camera and parameter.

    Those are of each camera the most correlated one, or else all where none is significant, or
    else the least significant.
    """
    weak = []
    for place in np.flatnonzero(new.any(axis=1)):
        variances = np.diag(covariances[place])
        with np.errstate(invalid='ignore', divide='ignore'):
            sigma = np.sqrt(variances)
            correlation = np.abs(covariances[place] / np.outer(sigma, sigma))
            change = fitted.calibrations[place] - before.calibrations[place]
            size = np.nan_to_num(np.abs(change) / sigma)
        if new[place, 0]:
            if not sigma[0] < _FOCAL_LENGTH * fitted.calibrations[place, 0]:
                weak.append((int(place), 0))
            continue
        np.fill_diagonal(correlation, 0)
        correlation = np.where(free[place] & free[place][:, None], correlation, 0)
        largest = np.where(new[place], correlation.max(axis=0), 0)
        smallest = np.where(new[place], size, np.inf)
        if largest.max() > _CORRELATED:
            weak.append((int(place), int(largest.argmax())))
        elif size[new[place]].max() < _SIGNIFICANT:
            weak += [(int(place), int(parameter)) for parameter in np.flatnonzero(new[place])]
        elif smallest.min() < _SIGNIFICANT:
            weak.append((int(place), int(smallest.argmin())))
    return weak
