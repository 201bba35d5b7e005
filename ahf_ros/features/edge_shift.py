"""The shift of the edges of dots that the gamma of a camera causes.

A camera's gamma makes a dark dot smaller and a bright one larger, by up to half of the standard
deviation of the blur; a linear camera does not. Where the bright side is saturated the shift is
several times as large, because the dark side of a blurred edge is all that is left of it. What is
printed about a dot lies in proportion to its true radius.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit

SMALL = 7.0
"""Radius below which the shift spoils the reading of what is printed about a dot, px."""

_MAXIMUM = 0.5  # of the shift, in the blur of the edge
_SATURATED = 1.25  # the same, beside a bright side that is saturated
_SATURATION = 250.0  # gray value


def unshifted(dots: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames that dots may have without the shift of their edges.

    Parameters
    ----------
    dots : Fit
        Of k dots.

    Returns
    -------
    which : ndarray of int, shape (n,)
        The dot of each frame: every dot, then those smaller than `SMALL` once more, and then those
        whose bright side is saturated.
    frames : ndarray of float64, shape (n, 3, 3)
        Of small dots without any shift and with the largest, of others with the mean. The last
        ones have the shift that saturation causes.
    """
    size = dots.size
    small, saturated = size < SMALL, dots.bright >= _SATURATION
    which = np.concatenate([np.arange(len(size)), *map(np.flatnonzero, (small, saturated))])
    first = np.where(small, 0.0, _MAXIMUM / 2)
    further = [np.full(small.sum(), _MAXIMUM), np.full(saturated.sum(), _SATURATED)]
    shifts = np.concatenate([first, *further])
    changes = np.zeros((len(which), 5))
    changes[:, 2] = dots.polarity[which] * shifts * dots.blur[which] / size[which]
    return which, frame.moved(dots.frames[which], changes)
