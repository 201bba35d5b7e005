"""Proposals of dots, and the measurement of those that may be middles of targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.circles import RAYS, REACH
from ahf_ros.detectors.ring.explained import Explained
from ahf_ros.detectors.ring.glance import may_be_targets
from ahf_ros.detectors.ring.polar import PART
from ahf_ros.features.circle_fit import NO_FITS, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.pyramid import Octave
from ahf_ros.features.soft_edges import MINIMUM_SHARE, ROUNDS, SOFT

Proposal = Callable[[Octave, Sequence[int], Explained], Dots]
"""From an octave, the polarities of dots and what is explained already to dots of the octave."""

_HOLDING = 22.0  # radius of a dot about which profiles hold the softest edge, px
_FAINTEST = 0.8  # contrast of a dot, dark over bright, for its band to be read


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
) -> Fit:
    """Return the fits of the dots whose bands are worth reading.

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
    worth = [NO_FITS]
    for start in range(0, len(dots.frames), PART):
        part = dots.select(slice(start, start + PART))
        fit = _fit(gray, part, covariances=keep_all)
        if not keep_all:
            fit = fit.select(may_be_targets(gray, fit, families))
        fit = _fit(gray, fit)
        # How soft an edge is shows only where a profile holds all of it.
        is_soft = (fit.blur > SOFT) & (fit.share >= MINIMUM_SHARE) & (fit.size > _HOLDING)
        soft = np.flatnonzero(is_soft)
        if soft.size:
            fit = fit.replaced(soft, _fit(gray, fit.select(soft), ROUNDS))
        worth.append(fit)
    fit = Fit.joined(worth)
    return fit.select((fit.share >= MINIMUM_SHARE) & (fit.contrast <= _FAINTEST))


def _fit(gray: np.ndarray, dots: Dots | Fit, rounds: int = 1, *, covariances: bool = True) -> Fit:
    """Return fits of dots, whose blur is that of an earlier fit or the usual one."""
    return fit_dots(
        gray,
        dots.frames,
        dots.polarity,
        rays=RAYS // 2,
        reach=REACH,
        rounds=rounds,
        blur=dots.blur if isinstance(dots, Fit) else None,
        covariances=covariances,
    )
