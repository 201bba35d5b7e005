"""Reading of the bands about dots, with the joint refinement of dot and band.

A pass goes from the samples of a band to the frame of dot and band. A correct reading improves the
frame, and a better frame the reading, so there are two passes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_evidence import band_evidence
from ahf_ros.detectors.ring.band_samples import sample_bands
from ahf_ros.detectors.ring.decoding import decode, sector_angles
from ahf_ros.detectors.ring.evidence import MarkAppearance
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.occluded_decoding import decode_occluded
from ahf_ros.detectors.ring.other_prints import of_other_prints
from ahf_ros.detectors.ring.target_circles import REACH, target_circles
from ahf_ros.features.circle_fit import Fit, fit_circles
from ahf_ros.features.edge_shift import SMALL, unshifted
from ahf_ros.features.sampling import sample_circles

PASSES = ((5, 1), (10, 2))
"""Samples per sector and rounds of the fit of each pass."""

_LEVEL_RADII = np.array([0.75, 1.4])  # dot radii, where the levels of dot and gap are read
_LEVEL_ANGLES = 2 * np.pi * np.arange(24) / 24
_MINIMUM_LEVEL = 1.0  # gray value that ratios are taken of
_PRINTED = 0.25  # usual contrast of prints


def read_bands(
    gray: np.ndarray,
    dots: Fit,
    family: Family,
    expected: frozenset[int] = frozenset(),
    passes: Sequence[tuple[int, int]] = PASSES,
    other_prints: bool = True,
    hidden: bool = True,
) -> tuple[Hypotheses, np.ndarray]:
    """Read the bands about dots, and refine dot and band together.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Fit
        Of k dots.
    family : Family
    expected : frozenset of int
        IDs that are likely to be there; all are alike where it is empty.
    passes : sequence of (int, int)
        As `PASSES` has them; one is enough where frames are right to a tenth of a pixel.
    other_prints : bool
        Whether words are refused where bands of other prints agree better.
    hidden : bool
        Whether words count that are plausible only where something hides a part of the band.

    Returns
    -------
    hypotheses : Hypotheses
        One of each dot, then a second one of each small dot.
    which : ndarray of int, shape (m,)
        The dot that each is of.
    """
    if not len(dots.frames):
        return Hypotheses.unread(dots, family), np.zeros(0, np.intp)
    which, frames = unshifted(dots)
    marks = mark_appearance(gray, dots).select(which)
    marks, lift, read, alone = marks.lifted(), marks.lift, np.arange(len(which)), frames
    for per_sector, rounds in passes:
        angles = sector_angles(family, per_sector)
        samples = sample_bands(gray, frames, marks.blur, angles, family, lift)
        evidence = band_evidence(samples, marks, frames, family)
        readings = decode(samples, evidence, marks, family)
        last = (per_sector, rounds) == PASSES[-1]
        good = readings.plausible | (hidden and last)
        if last and good.any():
            readings = decode_occluded(
                samples, evidence, readings, marks, frames, family, expected
            )
            good &= readings.plausible
        if not good.any():
            return Hypotheses.unread(dots.select(which), family), which
        read, readings, marks = read[good], readings.select(good), marks.select(good)
        lift = lift[good]
        words, starts = readings.words, readings.start
        circles = target_circles(words, starts, marks.polarity, per_sector, family)
        fit = fit_circles(
            gray,
            frames[good],
            circles,
            reach=REACH,
            projective=True,
            rounds=rounds,
            covariances=last,
        )
        frames = fit.frames
    foreign = np.zeros(len(read), bool)
    if other_prints:
        foreign = of_other_prints(gray, alone[read], fit, words, starts, per_sector, family)
    unread = Hypotheses.unread(dots.select(which), family)
    return unread.replaced(
        read, Hypotheses.read(readings, fit, unread.select(read), foreign)
    ), which


def mark_appearance(gray: np.ndarray, dots: Fit) -> MarkAppearance:
    """Return how marks about dots are expected to look.

    Their contrast is that of the dot's edge. Where a camera sharpens, that edge is darker than
    marks are, and where marks are small blur makes them less dark. The levels beside the edge then
    tell more; at large dots only up to the usual contrast of prints, because the light may change
    between them.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Fit
        Of k dots.
    """
    values = sample_circles(gray, dots.frames, _LEVEL_ANGLES, _LEVEL_RADII)
    inside, outside = np.moveaxis(np.maximum(values, _MINIMUM_LEVEL), 2, 0)
    ratio = np.median(inside / outside, axis=1) ** dots.polarity
    by_levels = np.where(dots.size < SMALL, ratio, np.minimum(ratio, _PRINTED))
    contrast = np.maximum(dots.contrast, by_levels)
    return MarkAppearance(dots.polarity, contrast, dots.bright, dots.blur)
