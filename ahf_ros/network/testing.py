"""Tests of an adjustment: variance of unit weight, and single observations.

An observation is tested against what all others say of it. With its residual v and the
covariance Q_v of that residual, v' Q_v^-1 v is chi-square of two degrees if it is right, whatever
the geometry [1]_. One that is not used is tested the same way by its prediction, so that none is
left out only because it once was.

References
----------
.. [1] Baarda, A testing procedure for use in geodetic networks, Netherlands Geodetic Commission
   1968; Förstner & Wrobel, Photogrammetric Computer Vision, 2016, 4.6.4.
.. [2] Lange, Little & Taylor, Robust statistical modeling using the t distribution, J. Am. Stat.
   Assoc. 84 (1989), 881-896; the likelihood is that of a distribution which ends at the longest.
"""

from importlib import import_module
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahf_ros.base.extras import need
from ahf_ros.network.image_points import BEHIND, Design, Layout, whitened_lengths
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import NetworkState

CRITICAL = 4.7
"""Normalised residual above which an observation is left out, as commercial programs have it."""

SIGNIFICANCE = 0.05
"""Error probability of the test of the variance of unit weight."""

MISFIT = 3.0
"""sigma0 that is no matter of weights."""

BY_CHANCE = 0.001
"""Error probability at which something that was told, or a second place, is named."""

_NORMAL = 1e4  # degrees of freedom of what is as good as normal
_FREEDOMS = (3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0, 40.0, _NORMAL)
_SCALES = np.linspace(0.85, 1.15, 31)  # that are tried, in those that the median has
_ENOUGH = 5000  # lengths that determine a distribution
_CLEARLY = 4.0  # log likelihood by which heavier tails must be better

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


class Tails(NamedTuple):
    """How residuals are spread: a t-distribution in the plane, of a scale and degrees of freedom.

    Its lengths r exceed c with the probability (1 + c² / (freedom scale²)) ^ (-freedom / 2).
    """

    scale: float
    freedom: float

    @property
    def deviation(self) -> float:
        """Standard deviation of a coordinate."""
        return float(self.scale * np.sqrt(self.freedom / (self.freedom - 2)))

    def beyond(self, length: float) -> float:
        """Return the probability of a longer residual."""
        unit = (length / self.scale) ** 2 / self.freedom
        return float((1 + unit) ** (-self.freedom / 2))


def tails(lengths: FloatArray) -> Tails:
    """Return the most likely distribution of lengths (m,), of which longer ones are cut off [2]_.

    It is about normal unless the lengths say clearly that their tails are heavier.
    """
    ordered = np.sort(lengths[np.isfinite(lengths)])
    if not len(ordered) or ordered[-1] <= 0:
        return Tails(1.0, _NORMAL)
    step = max(1, len(ordered) // _ENOUGH)
    squares, cut = ordered[step // 2 :: step] ** 2, ordered[-1]
    best = -np.inf, Tails(1.0, _NORMAL)
    for freedom in _FREEDOMS:
        middle = np.median(ordered) / np.sqrt(freedom * (2 ** (2 / freedom) - 1))
        for scale in middle * _SCALES:
            unit = 2 * np.log(scale) + (freedom / 2 + 1) * np.log1p(squares / freedom / scale**2)
            found = Tails(float(scale), freedom)
            seen = np.log1p(-found.beyond(cut))
            likelihood = -step * float(unit.sum() + len(unit) * seen)
            likelihood += _CLEARLY if freedom == _NORMAL else 0.0
            best = max(best, (likelihood, found))
    return best[1]


def normalised(
    layout: Layout,
    state: NetworkState,
    design: Design,
    computed: FloatArray,
    used: NDArray[np.bool_],
) -> FloatArray:
    """Return residuals (m,) over their standard deviations, of observations used (m,) or not.

    `computed` (m, 2, 2) are the whitened covariances of computed image points. Results are
    lengths of 2-vectors. One that no other checks, and whose residual is therefore zero, has NaN.
    """
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
