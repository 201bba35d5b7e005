"""Circles whose edges turn out to be soft, measured on profiles that are long enough for them.

How soft edges are is known only when they have been measured. A step that is sharper than an edge
is fitted to a part of it, at the wrong place.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ahf_ros.features.circle_fit import ENOUGH, Fit, fit_circles
from ahf_ros.features.circles import Circles

SOFT = 1.0
"""Blur from which on an edge is soft, standard deviation in px."""

ROUNDS = 4
"""How often soft edges are measured."""


def fit_circles_of_any_blur(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    *,
    reach: float | np.ndarray,
    projective: bool,
    rounds: int = 2,
) -> Fit:
    """Move frames onto the edges of circles, and those with soft edges once more.

    Parameters
    ----------
    gray, frames, circles, reach, projective, rounds
        As for `ahf_ros.features.circle_fit.fit_circles`.
    """
    fit = fit_circles(gray, frames, circles, reach=reach, projective=projective, rounds=rounds)
    soft = np.flatnonzero((fit.blur > SOFT) & (fit.share >= ENOUGH))
    if not soft.size:
        return fit
    first = fit.select(soft)
    again = fit_circles(
        gray,
        first.frames,
        replace(circles, polarity=circles.polarity[soft]),
        reach=np.broadcast_to(reach, (len(frames), 1))[soft],
        projective=projective,
        rounds=ROUNDS,
        blur=first.blur,
    )
    good = again.share >= ENOUGH
    return fit.replaced(soft[good], again.select(good))
