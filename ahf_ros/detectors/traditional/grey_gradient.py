"""Bands read by their grey gradient, under light that is even across a target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.frame import circle_points, project
from ahf_ros.features.sampling import sample, within

_SAMPLES = 12  # directions in which a sector is sampled
_DOT_RADIUS = 0.6  # where the dot is read, dot radii
_GAP_DEPTHS = (0.4, 0.6)  # shares of the width of the gap, where it is read
_BAND_DEPTHS = (0.3, 0.5, 0.7)  # shares of the width of the band, where it is read
_MARGIN = 0.5  # distance from the band at which the margin of a target is read, dot radii
_DOT_PERCENTILE, _GROUND_PERCENTILE = 10, 90  # of the readings, the dot being the larger
# The dot has the level 1, the ground 0. They part below a half, because the gap shows
# the ground in all directions, the darkest included, but the dot shows its colour in one place.
_LEVEL = 0.4
_STEEPNESS = 4.0  # of the profile about that level
_MINIMUM_MARGIN = 0.85  # share of the margin that has to have the colour of the ground
_MINIMUM_CLARITY = 0.15  # distance of a sector's mean from the level halfway
_MINIMUM_COHERENCE = 0.6  # agreement of the grey gradient with one division into sectors, 0 to 1
_MINIMUM_DEVIATION = 0.1  # of samples from 0 or 1, from which certainties are computed
_NO_GRADIENT = 1e-9  # instead of a sum of none


@dataclass(frozen=True, slots=True)
class BandReadings(ArrayRecord):
    """The words read from k bands.

    Attributes
    ----------
    surrounded : ndarray of bool, shape (k,)
        Whether a gap of one colour lies round the dot, in the image.
    words : ndarray of int64, shape (k,)
        The words read, in any rotation.
    starts : ndarray of float64, shape (k,)
        Where the sector of the lowest bit starts, rad counter-clockwise from +x of the frame.
    certainty : ndarray of float64, shape (k,)
        Probability that the word is right if the target is one, sectors being two gray values
        with normal errors; 0 where gap, band or margin do not look like a target's.
    """

    surrounded: np.ndarray
    words: np.ndarray
    starts: np.ndarray
    certainty: np.ndarray


def read_by_gradient(
    gray: np.ndarray, frames: np.ndarray, polarity: int, family: Family
) -> BandReadings:
    """Read the bands of targets of one polarity.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
    frames : ndarray of float64, shape (k, 3, 3)
    polarity : int
        1 for dark targets, -1 for bright ones.
    family : Family
    """
    inner, outer = family.band_inner, family.band_outer
    gap = 1 + (inner - 1) * np.array(_GAP_DEPTHS)
    band = inner + (outer - inner) * np.array(_BAND_DEPTHS)
    angles = -2 * np.pi * np.arange(_SAMPLES * family.bits) / (_SAMPLES * family.bits)
    radii = np.concatenate([[_DOT_RADIUS], gap, band, [outer + _MARGIN]])
    pixels = project(frames, circle_points(angles, radii))
    values = -polarity * sample(gray, pixels)  # the larger, the more like the dot
    of_dot, of_gap, of_band, of_margin = np.split(
        values, np.cumsum([1, len(gap), len(band)]), axis=2
    )
    inside = np.all(within(pixels, gray.shape), axis=1)

    dot = np.percentile(of_dot[..., 0], _DOT_PERCENTILE, axis=1)
    ground = np.percentile(of_gap, _GROUND_PERCENTILE, axis=(1, 2))
    contrast = np.where(dot > ground, dot - ground, np.inf)[:, None, None]
    ground = ground[:, None, None]
    surrounded = (dot > ground[:, 0, 0]) & inside[:, len(gap)]
    margin = ((of_margin - ground) / contrast < _LEVEL)[..., 0].mean(axis=1)
    levels = ((of_band - ground) / contrast).mean(axis=2)
    profiles = np.clip(_STEEPNESS * (levels - _LEVEL) + 0.5, 0, 1)
    means, starts, deviation, coherence = _sectors(profiles, family.bits)
    words = (means > 0.5) @ (1 << np.arange(family.bits))
    spread = np.maximum(deviation, _MINIMUM_DEVIATION)[:, None]
    odds = np.abs(2 * means - 1) / (2 * spread**2)
    certainty = np.prod(1 / (1 + np.exp(-odds)), axis=1)
    whole = surrounded & inside[:, len(gap) + len(band)] & (margin > _MINIMUM_MARGIN)
    whole &= np.abs(means - 0.5).min(axis=1) > _MINIMUM_CLARITY
    whole &= coherence > _MINIMUM_COHERENCE
    return BandReadings(surrounded, words, starts, np.where(whole, certainty, 0.0))


def _sectors(profiles: np.ndarray, bits: int) -> tuple[np.ndarray, ...]:
    """Divide the profiles of n bands into sectors at the phase of their grey gradient.

    Parameters
    ----------
    profiles : ndarray, shape (n, _SAMPLES * bits)
        0 where the band has the colour of the ground, 1 where it has the dot's.
    bits : int
        Number of sectors.

    Returns
    -------
    means : ndarray, shape (n, bits)
        Mean of the middle half of each sector, counter-clockwise.
    starts : ndarray, shape (n,)
        Where the first sector starts, rad counter-clockwise.
    deviation : ndarray, shape (n,)
        RMS distance of the samples there from 0 or 1, whichever is nearer to the mean.
    coherence : ndarray, shape (n,)
        1 where the gradient lies at the edges of the sectors alone, 0 where it lies anywhere.
    """
    count, samples = profiles.shape
    gradient = np.abs(profiles - np.roll(profiles, 1, axis=1))
    turn = 2 * np.pi * (np.arange(samples) - 0.5) / _SAMPLES
    resultant = gradient @ np.exp(1j * turn)
    coherence = np.abs(resultant) / np.maximum(gradient.sum(axis=1), _NO_GRADIENT)
    first = np.rint(np.angle(resultant) / (2 * np.pi) * _SAMPLES).astype(int)
    quarter = _SAMPLES // 4
    middle = np.arange(quarter, _SAMPLES - quarter + 1)
    angles = (np.arange(bits) * _SAMPLES)[:, None] + middle
    angles = (first[:, None] + angles.ravel()) % samples
    sectors = np.take_along_axis(profiles, angles, axis=1).reshape(count, bits, middle.size)
    means = sectors.mean(axis=2)
    errors = sectors - (means > 0.5)[:, :, None]
    deviation = np.sqrt((errors**2).mean(axis=(1, 2)))
    return means, 2 * np.pi * first / samples, deviation, coherence
