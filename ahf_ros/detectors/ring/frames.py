"""Frames of ring targets, fitted to the edges of dot and band."""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit, fit_circles
from ahf_ros.features.circles import Circles, dot_circles

_REACH = 0.45  # distance from an expected edge to look for it, dot radii: less than half a gap
_RAYS = 48  # about a dot, where its band is fitted with it
_INNER_PART = 0.4  # of a sector, to either side; next to its ends the blur rounds an arc off
_SHIFT = 0.5  # of an edge towards the dark side, in its blur, at the most

SMALL = 7.0
"""Radius of dots below which the shift of their edge spoils the reading of the band, px."""


def fit_dots(
    gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray, rays: int, rounds: int = 2
) -> Fit:
    """Fit the ellipses of dots; see `fit_circles`.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        To about two pixels.
    polarity : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points about a dot.
    rounds : int
        Number of measurements.
    """
    circles = dot_circles(polarity, rays)
    return fit_circles(gray, frames, circles, reach=_REACH, projective=False, rounds=rounds)


def fit_dots_and_bands(
    gray: np.ndarray, frames: np.ndarray, circles: Circles, rounds: int = 2
) -> Fit:
    """Fit dot and band together, whose common centre is that of the target; see `fit_circles`.

    Parameters
    ----------
    gray, frames, rounds
        As for `fit_dots`.
    circles : Circles
        Of `target_circles`.
    """
    return fit_circles(gray, frames, circles, reach=_REACH, projective=True, rounds=rounds)


def target_circles(
    words: np.ndarray,
    starts: np.ndarray,
    polarity: np.ndarray,
    samples: int,
    family: Family,
    rays: int = _RAYS,
) -> Circles:
    """Return the edges of ring targets: round the dots and along the marked sectors.

    Parameters
    ----------
    words : ndarray of int64, shape (k,)
        Code words, in any rotation.
    starts : ndarray of float, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    polarity : ndarray of int, shape (k,)
        1 for a dark target, -1 for a bright one.
    samples : int
        Number of points on each edge of the band, a sector.
    family : Family
    rays : int
        Number of points round the dot.
    """
    dot = dot_circles(polarity, rays)
    count = family.bits * samples
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    sector, depth = np.divmod((angles - starts[:, None]) * family.bits / (2 * np.pi), 1)
    bits = words[:, None] >> sector.astype(np.int64) % family.bits & 1
    marked = np.where(np.abs(depth - 0.5) < _INNER_PART, bits, 0) * polarity[:, None]
    return Circles(
        np.concatenate([dot.angles, -angles, -angles]),
        np.concatenate([dot.radii, np.repeat([family.band_inner, family.band_outer], count)]),
        np.concatenate([dot.group, np.ones(2 * count, int)]),
        np.concatenate([dot.polarity, -marked, marked], axis=1),
    )


def unshifted(fit: Fit, polarity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which dots to read, and their frames without the shift of the dot's edge.

    A camera's gamma makes a dark dot smaller and a bright one larger, by up to half of the
    standard deviation of the blur; a linear camera does not. The band, up to 3.5 radii away, needs
    the scale: dots smaller than `SMALL` are read with either, others with the mean.

    Parameters
    ----------
    fit : Fit
        Of k dots.
    polarity : ndarray of int, shape (k,)

    Returns
    -------
    which : ndarray of int, shape (n,)
        Every dot, then the small ones a second time.
    frames : ndarray of float64, shape (n, 3, 3)
    """
    size = frame.mean_radii(fit.frames)
    small = size < SMALL
    which = np.concatenate([np.arange(len(size)), np.flatnonzero(small)])
    share = np.concatenate([np.where(small, 0.0, 0.5), np.ones(small.sum())])
    changes = np.zeros((len(which), 5))
    changes[:, 2] = polarity[which] * _SHIFT * share * fit.blur[which] / size[which]
    return which, frame.moved(fit.frames[which], changes)
