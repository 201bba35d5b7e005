"""Dots out of focus, whose bands are read in the half of the image.

An edge is measured within a few pixels, which do not hold all of a soft one: its contrast seems
too low there, and its blur too small. In the half of the image it is sharp enough.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.dots import NO_DOTS, Dots

_BLUR = 1.2  # measured, of a dot that is soft, px
_RADIUS = 8.0  # of a dot whose half is large enough, px
_MANY, _FEWEST = 256, 5  # soft dots of a lattice; certain targets that tell whether it is one
_MIDDLE = 0.3  # distance of a soft dot from the middle of a soft target, dot radii
_MOSTLY = 0.5  # share of these that are soft where it is none


def soft_dots(parts: Sequence[tuple[Fit, Hypotheses]]) -> Dots:
    """Return the soft dots of an image that are not certain yet, px of its half.

    Where most certain targets are sharp, the many soft dots of a lattice are spots of light.

    Parameters
    ----------
    parts : sequence of (Fit, Hypotheses)
        The dots of the image, and what they were read as.
    """
    if not parts:
        return NO_DOTS
    fits = Fit.joined([fit for fit, _ in parts])
    read = Hypotheses.joined([read for _, read in parts])
    soft = np.flatnonzero((fits.blur > _BLUR) & (fits.size > _RADIUS))
    certain = read.select(read.certain)
    away = fits.frames[soft, None, :2, 2] - certain.frames[:, :2, 2]
    distance = np.hypot(away[..., 0], away[..., 1])
    if len(soft) > _MANY and len(certain.frames) >= _FEWEST:
        _, minor, _ = frame.ellipse_axes(certain.frames)
        if (distance < _MIDDLE * minor).any(axis=0).mean() < _MOSTLY:
            soft, distance = soft[:0], distance[:0]
    soft = soft[(distance > certain.reach).all(axis=1)]
    frames = frame.enlarged(fits.frames[soft], -1)
    return Dots(frames, fits.polarity[soft], fits.share[soft])
