"""Words that no light explains.

A mark in the light and the ground in shadow may be of one gray value, so that a spot of light as
large as a sector makes a mark look like the ground. But whatever the light, the ground is nowhere
darker than in the deepest shadow on the target, and a dark mark nowhere brighter than in the
brightest light. What a spot leaves of a mark in shadow is too dark to be ground.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.decoding import bits_at, sums_of_sectors
from ahf_ros.detectors.ring.evidence import NOISE, MarkAppearance
from ahf_ros.features.frame import mean_radii
from ahf_ros.imaging.logarithm import LOG_OFFSET

_EXTREME = 3.0  # percentile of the ground that is the darkest, and from above the brightest
_BEYOND, _DEVIATIONS = 0.4, 3.0  # of the step of a mark, below the ground, and of noise
_BESIDE, _BESIDE_SOFT = 2.0, 2.0  # distance from a mark, px, and how fast it grows
_SHARP = 0.5  # blur of an edge, px, from which it grows
_SHARE, _FEWEST = 0.03, 10.0  # of the readings of a sector, or of so many if there are fewer


def are_impossible(
    samples: BandSamples,
    words: np.ndarray,
    phases: np.ndarray,
    hidden: np.ndarray,
    marks: MarkAppearance,
    frames: np.ndarray,
    family: Family,
) -> np.ndarray:
    """Return whether some sector has levels that its bit cannot have, ndarray of bool, shape (k,).

    Parameters
    ----------
    samples : BandSamples
        Of k targets, at the angles of `sector_angles`.
    words, phases : ndarray of int, shape (k,)
    hidden : ndarray of bool, shape (k, m)
        Whether something hides the band at each angle.
    marks : MarkAppearance
    frames : ndarray of float64, shape (k, 3, 3)
        Of the targets.
    family : Family
    """
    bits = bits_at(words, phases, hidden.shape[1] // family.bits, family)
    # With their signs changed, bright marks on dark ground are dark ones on bright ground.
    sign = marks.polarity[:, None]
    band = np.stack([samples.inner_band, *samples.band, samples.outer_band], axis=1)
    levels = sign[:, None] * np.log(band + LOG_OFFSET)
    ground = sign * np.log(np.concatenate(samples.ground, axis=1) + LOG_OFFSET)
    darkest, brightest = (of[:, None, None] for of in _limits(ground, marks))
    beyond = np.where(bits[:, None], levels > brightest, levels < darkest)
    seen = ~hidden & samples.visible.all(axis=0) & ~_near_borders(bits, marks, frames, family)
    beyond_limits = sums_of_sectors(beyond.sum(axis=1) * seen, phases, family.bits)
    readings = sums_of_sectors(band.shape[1] * seen, phases, family.bits)
    impossible: np.ndarray = (beyond_limits > _SHARE * np.maximum(readings, _FEWEST)).any(axis=1)
    return impossible


def _limits(ground: np.ndarray, marks: MarkAppearance) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest levels that are ground, and the highest ones that are marks, (k,) both.

    Parameters
    ----------
    ground : ndarray of float, shape (k, n)
        Levels of the ground, as if marks were dark.
    marks : MarkAppearance
    """
    sign = marks.polarity[:, None]
    extremes = np.percentile(ground, [_EXTREME, 100 - _EXTREME], axis=1).T
    gray = np.maximum(np.exp(sign * extremes) - LOG_OFFSET, 0)
    step = np.abs(marks.step(np.where(sign > 0, gray, gray / marks.contrast[:, None])))
    levels = extremes - step * [0, 1]  # of the darkest ground and of the brightest mark
    noise = _DEVIATIONS * NOISE * np.exp(-sign * levels)
    beyond = np.maximum(step * [_BEYOND, 1 - _BEYOND], noise)
    darkest, brightest = (levels + beyond * [-1, 1]).T
    return darkest, brightest


def _near_borders(
    bits: np.ndarray, marks: MarkAppearance, frames: np.ndarray, family: Family
) -> np.ndarray:
    """Return whether angles are near to borders of marks, ndarray of bool, shape (k, m)."""
    beside = _BESIDE + _BESIDE_SOFT * np.maximum(marks.blur - _SHARP, 0)
    spacing = 2 * np.pi * family.band_inner * mean_radii(frames) / bits.shape[1]
    steps = (beside / spacing + 0.5)[:, None]
    near = np.zeros(bits.shape, bool)
    for away in range(1, bits.shape[1] // family.bits + 1):
        other = np.roll(bits, away, axis=1) ^ bits
        other |= np.roll(bits, -away, axis=1) ^ bits
        near |= other & (away < steps)
    return near
