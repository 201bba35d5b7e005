"""Whether the edges about a dot are those of another print than the one that was read.

Prints of one number of sectors differ only in the radii of their bands. A target of one of them
may be read as the other, but then its edges do not lie where they should.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import BAND_RADII, Family
from ahf_ros.detectors.ring.target_circles import REACH, target_circles
from ahf_ros.features.circle_fit import Fit, fit_circles

SHARP = 4.5
"""Sharpness of edges that are those of no other print."""

_ANYWHERE = 0.2  # deviation of edges that are not in their place, dot radii
_MINIMUM_DEVIATION = 0.001  # of edges, below which it says no more, dot radii
_CLEARLY = 1.0  # sharper


def sharpness(fit: Fit) -> np.ndarray:
    """Return the mean of ln of the probability density of edges in their places, shape (k,).

    Parameters
    ----------
    fit : Fit
        Edges in their place have its deviation, in dot radii; the others may be anywhere.
    """
    deviation = np.log(fit.deviation / fit.size + _MINIMUM_DEVIATION)
    return np.asarray(-fit.share * deviation - (1 - fit.share) * np.log(_ANYWHERE))


def attainable_sharpness(sharp: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the sharpness that words would have with all edges in their places, shape (k,).

    Parameters
    ----------
    sharp : ndarray of float64, shape (k,)
        As `sharpness` gives it.
    share : ndarray of float64, shape (k,)
        Share of the edges that are in their places; not 0.
    """
    return np.asarray((sharp + (1 - share) * np.log(_ANYWHERE)) / share)


def of_other_prints(
    gray: np.ndarray,
    dots: np.ndarray,
    fit: Fit,
    words: np.ndarray,
    starts: np.ndarray,
    per_sector: int,
    family: Family,
) -> np.ndarray:
    """Return whether bands of other radii agree better with the edges, shape (k,).

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : ndarray of float64, shape (k, 3, 3)
        Frames of the dots alone.
    fit : Fit
        Of dots and bands.
    words, starts, per_sector
        As for `target_circles`.
    family : Family
    """
    own = sharpness(fit)
    doubtful = np.flatnonzero(own < SHARP)
    foreign = np.zeros(len(own), bool)
    for inner, outer in BAND_RADII.values():
        if (inner, outer) == family.band or not len(doubtful):
            continue
        circles = target_circles(
            words[doubtful],
            starts[doubtful],
            fit.polarity[doubtful],
            per_sector,
            family.with_band(inner, outer),
        )
        other = fit_circles(
            gray, dots[doubtful], circles, reach=REACH, projective=True, covariances=False
        )
        foreign[doubtful] |= sharpness(other) > own[doubtful] + _CLEARLY
    return foreign
