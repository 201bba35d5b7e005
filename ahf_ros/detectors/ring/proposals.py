"""Proposals of dots, and the measurement of those that may be middles of targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.circles import RAYS, REACH
from ahf_ros.detectors.ring.explained import Explained
from ahf_ros.detectors.ring.glance import may_be_targets
from ahf_ros.detectors.ring.polar import PART
from ahf_ros.features.circle_fit import ENOUGH, NO_FITS, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.pyramid import Octave

Proposal = Callable[[Octave, Sequence[int], Explained], Dots]
"""From an octave, the polarities of dots and what is explained already to dots of the octave."""


def propose_whole(octave: Octave, polarities: Sequence[int], _explained: Explained) -> Dots:
    """Return the dots of an octave with a whole outline."""
    return whole_dots(octave.pyramid, *octave.radii, polarities)


def propose_voted(octave: Octave, polarities: Sequence[int], explained: Explained) -> Dots:
    """Return the dots of an octave that edges vote for which nothing explains yet."""
    outlines = explained.outlines_in(octave.level)
    return voted_dots(octave.pyramid, *octave.radii, polarities, explained=outlines)


PROPOSALS: tuple[Proposal, ...] = (propose_whole, propose_voted)
"""The ways to propose dots, the fastest first."""


def measure_dots(
    gray: np.ndarray, dots: Dots, families: Sequence[Family], *, keep_all: bool = False
) -> tuple[Fit, Fit]:
    """Return the fits of the dots whose bands are worth reading, and those of the others.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Dots
        In px of the image.
    families : sequence of Family
    keep_all : bool
        Whether dots that are no middles of targets are measured as well.
    """
    worth, others = [NO_FITS], [NO_FITS]
    for start in range(0, len(dots.frames), PART):
        part = dots.select(slice(start, start + PART))
        fit = _fit(gray, part, covariances=keep_all)
        if not keep_all:
            likely = may_be_targets(gray, fit, families)
            others.append(fit.select(~likely))
            fit = fit.select(likely)
        worth.append(_fit(gray, fit))
    fit = Fit.joined(worth)
    return fit.select(fit.share >= ENOUGH), Fit.joined(others)


def _fit(gray: np.ndarray, dots: Dots | Fit, *, covariances: bool = True) -> Fit:
    """Return fits of dots, whose blur is that of an earlier fit or the usual one."""
    return fit_dots(
        gray,
        dots.frames,
        dots.polarity,
        rays=RAYS // 2,
        reach=REACH,
        rounds=1,
        blur=dots.blur if isinstance(dots, Fit) else None,
        covariances=covariances,
    )
