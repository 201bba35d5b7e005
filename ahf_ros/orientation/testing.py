"""Tests of an adjustment: variance of unit weight, and single observations.

An observation is tested against what all others say of it. With its residual v and the
covariance Q_v of that residual, v' Q_v^-1 v is chi-square of two degrees if it is right, whatever
the geometry [1]_. One that is not used is tested the same way by its prediction, so that none is
left out only because it once was.

References
----------
.. [1] Baarda, A testing procedure for use in geodetic networks, Netherlands Geodetic Commission
   1968; Förstner & Wrobel, Photogrammetric Computer Vision, 2016, 4.6.4.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahf_ros.extras import need
from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.normals import BEHIND, Design, Layout, whitened_lengths
from ahf_ros.orientation.precision import Precision, of_computed
from ahf_ros.orientation.solution import Start

CRITICAL = 4.7
"""Normalised residual above which an observation is left out, as commercial programs have it."""

SIGNIFICANCE = 0.05
"""Error probability of the test of the variance of unit weight."""

_CHECKED = 1e-9  # share of a residual that must be left by the adjustment for it to be tested


class UnitWeight(NamedTuple):
    """Square root of the variance of unit weight, its redundancy, and whether 1 is plausible."""

    sigma0: float
    redundancy: int
    plausible: bool


def special() -> ModuleType:
    """Return scipy.special, or raise a `MissingExtra`."""
    need('orient', 'scipy')
    return import_module('scipy.special')


def unit_weight(cost: float, redundancy: int) -> UnitWeight:
    """Return the estimate and its two-sided chi-square test against 1, at 5 %.

    Without redundancy it is 1. Raises a `MissingExtra` without scipy.
    """
    if redundancy <= 0:
        return UnitWeight(1.0, redundancy, True)
    low, high = special().chdtri(redundancy, [1 - SIGNIFICANCE / 2, SIGNIFICANCE / 2])
    return UnitWeight(float(np.sqrt(cost / redundancy)), redundancy, bool(low <= cost <= high))


def normalised(
    layout: Layout, state: Start, design: Design, known: Precision, used: NDArray[np.bool_]
) -> FloatArray:
    """Return residuals (m,) over their standard deviations, of observations used (m,) or not.

    These are lengths of 2-vectors. One that no other checks, and whose residual is therefore zero,
    has NaN.
    """
    computed = of_computed(layout, design, known)
    of_residual = np.eye(2) + np.where(used, -1, 1)[:, None, None] * computed
    sizes, axes = np.linalg.eigh(of_residual)
    along = (axes.transpose(0, 2, 1) @ design.misclosure[:, :, None])[:, :, 0]
    checked = sizes > _CHECKED
    with np.errstate(invalid='ignore', divide='ignore'):
        squares = np.where(checked, along**2 / sizes, 0).sum(axis=1)
    lengths = np.where(checked.any(axis=1), np.sqrt(squares), np.nan)
    behind = whitened_lengths(layout, state) >= BEHIND
    return np.where(behind, np.inf, lengths)


def worst(layout: Layout, lengths: FloatArray, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the used observations (m,) that are the worst of their photograph and their point.

    These hardly disturb each other, and so may be left out at once.
    """
    sizes = np.where(used, np.nan_to_num(lengths), 0)
    of_image = np.zeros(len(layout.photographs))
    of_point = np.zeros(len(layout.points))
    np.maximum.at(of_image, layout.photograph, sizes)
    np.maximum.at(of_point, layout.point, sizes)
    return (
        used
        & (sizes > 0)
        & (sizes == of_image[layout.photograph])
        & (sizes == of_point[layout.point])
    )
