"""Dots out of focus, whose bands are read in the half of the image.

An edge is measured within a few pixels, which do not hold all of a soft one: its contrast seems
too low there, and its blur too small. In the half of the image it is sharp enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.dots import NO_DOTS, Dots

_MANY = 256  # soft dots, beyond which they may be spots of a lattice
_BLUR = 1.2  # measured, of a dot that is soft, px
_MAYBE_SOFT = 0.92  # the same, of a dot measured once
_RADIUS = 8.0  # of a dot whose half is large enough, px
_FEWEST = 5  # certain targets that tell whether targets are in focus
_MIDDLE = 0.3  # distance of a soft dot from the middle of a soft target, dot radii
_MOSTLY = 0.5  # share of these that are soft where it is none


def soft_dots(
    parts: Sequence[tuple[Fit, Hypotheses]], unlikely: Fit, again: Callable[[Fit], Fit]
) -> Dots:
    """Return the soft dots of an image that are not certain yet, px of its half.

    Where most certain targets are sharp, the many soft dots of a lattice are spots of light.

    Parameters
    ----------
    parts : sequence of (Fit, Hypotheses)
        The dots of the image, and what they were read as.
    unlikely : Fit
        Dots that were not worth reading, measured once.
    again : callable
        Returns better fits of dots; only a second one tells how soft an edge is.
    """
    if not parts:
        return NO_DOTS
    soft, certain = _soft_and_certain(parts)
    soft = soft.select(soft.size > _RADIUS)
    unlikely = unlikely.select((unlikely.size > _RADIUS) & (unlikely.blur > _MAYBE_SOFT))
    if len(soft.frames) + len(unlikely.frames) > _MANY and in_focus(parts):
        return NO_DOTS
    unlikely = again(unlikely)
    soft = Fit.joined([soft, unlikely.select(unlikely.blur > _BLUR)])
    soft = soft.select(np.all(_distances(soft, certain) > certain.reach, axis=1))
    return Dots(frame.enlarged(soft.frames, -1), soft.polarity, soft.share)


def in_focus(parts: Sequence[tuple[Fit, Hypotheses]]) -> bool:
    """Return whether enough targets are certain and most of them are sharp.

    Parameters
    ----------
    parts : sequence of (Fit, Hypotheses)
        As for `soft_dots`.
    """
    if not parts:
        return False
    soft, certain = _soft_and_certain(parts)
    if len(certain.frames) < _FEWEST:
        return False
    _, minor, _ = frame.ellipse_axes(certain.frames)
    are_soft = (_distances(soft, certain) < _MIDDLE * minor).any(axis=0)
    return bool(are_soft.mean() < _MOSTLY)


def _soft_and_certain(parts: Sequence[tuple[Fit, Hypotheses]]) -> tuple[Fit, Hypotheses]:
    fits = Fit.joined([fit for fit, _ in parts])
    read = Hypotheses.joined([read for _, read in parts])
    return fits.select(fits.blur > _BLUR), read.select(read.certain)


def _distances(dots: Fit, targets: Hypotheses) -> np.ndarray:
    """Return the distances of k dots from n targets, px, shape (k, n)."""
    away = dots.frames[:, None, :2, 2] - targets.frames[:, :2, 2]
    distances: np.ndarray = np.hypot(away[..., 0], away[..., 1])
    return distances
