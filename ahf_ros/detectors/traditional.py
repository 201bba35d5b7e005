"""Traditional identification: threshold, contours, gates, ellipse fit, grey gradient of the band.

This is the identification "TI" that the paper [1]_ drives beside Agisoft Metashape: an adaptive
threshold, contours whose perimeter and roundness are those of a dot, a least-squares ellipse, and
the coded band read by its grey gradient in the affine frame of that ellipse. It has no defence of
its own against uneven light, which makes it the fair test of a filter that has.

Its centre is that of the ellipse of the dot. The image of the physical centre differs from it by
the perspective bias, 0.03 px for a dot of 20 px radius at 45 degrees, which is not removed here.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.detector import DetectorSettings
from ahf_ros.detectors.frames import (
    Dots,
    dots_from_ellipses,
    inside,
    refined,
    sampled,
    semi_axes,
)
from ahf_ros.image import check_image
from ahf_ros.target import UNDECODED, Target

THRESHOLD_BLOCK = 81
"""Side of the square over which the adaptive threshold takes its mean, px."""

THRESHOLD_OFFSET = 8
"""Contrast to that mean that makes a pixel part of a blob, gray values of 8 bit."""

MINIMUM_ROUNDNESS = 0.5
"""Smallest 4 pi area / perimeter^2 of a dot; an ellipse seen at 70 degrees has 0.65."""

MAXIMUM_MISFIT = 0.12
"""Largest relative difference between the area of a contour and that of its ellipse."""

SAMPLES_PER_SECTOR = 12
"""Directions in which the band of a target is sampled, per sector of the code."""

MARGIN = 0.35
"""Distance from the band at which the margin of a target is tested, in radii of the dot."""

MINIMUM_CLARITY = 0.15
"""Least distance of a sector's mean from half the contrast of the dot, relative to that."""

MINIMUM_COHERENCE = 0.6
"""Least agreement of the band's grey gradient with one division into sectors, 0 to 1."""

CHUNK = 1024
"""Candidates measured at once, which bounds the memory."""


@dataclass(frozen=True, slots=True)
class TraditionalDetector:
    """The detector `traditional`; call it with an image.

    Attributes
    ----------
    settings : DetectorSettings
        What the targets look like.
    name : str
        'traditional'.
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)
    name: str = field(default='traditional', init=False)

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Of several targets that claim one ID the most certain keeps it, the others are undecoded.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
            Gray values. The threshold sees them scaled to 8 bit, extremes to 0 and 255; edges and
            bands are measured in the image as it is.

        Returns
        -------
        list of Target
            Sorted by ID, undecoded targets (only with `report_undecoded`) first.

        Raises
        ------
        ValueError
            If `image` is not an image, see `ahf_ros.image.check_image`.
        """
        check_image(image)
        gray = _eight_bit(image)
        found: list[Target] = []
        for polarity in ('dark', 'bright'):
            if self.settings.polarity in ('auto', polarity):
                candidates = _candidates(gray, polarity == 'bright', self.settings)
                for start in range(0, len(candidates.centres), CHUNK):
                    chunk = candidates.chosen(slice(start, start + CHUNK))
                    found += _identified(image, chunk, self.settings)
        targets = _settled(found)
        if not self.settings.report_undecoded:
            targets = [target for target in targets if target.id != UNDECODED]
        return sorted(targets, key=lambda target: (target.id, target.y, target.x))


def _eight_bit(image: np.ndarray) -> np.ndarray:
    if image.dtype == np.uint8:
        return image
    scaled = np.empty(image.shape, np.uint8)
    return cv2.normalize(image, scaled, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)


def _candidates(gray: np.ndarray, bright: bool, settings: DetectorSettings) -> Dots:
    """Return the blobs of an 8-bit image that pass the gates of a dot."""
    mask = cv2.adaptiveThreshold(
        gray,
        255,
        cv2.ADAPTIVE_THRESH_MEAN_C,
        cv2.THRESH_BINARY if bright else cv2.THRESH_BINARY_INV,
        THRESHOLD_BLOCK,
        -THRESHOLD_OFFSET if bright else THRESHOLD_OFFSET,
    )
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    shortest = max(5.0, 2 * settings.min_radius)
    longest = 2 * np.pi * (settings.max_radius + 2)
    ellipses = []
    for index, contour in enumerate(contours):
        if not shortest <= len(contour) <= longest or hierarchy[0, index, 3] >= 0:
            continue
        area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, closed=True)
        if 4 * np.pi * area < MINIMUM_ROUNDNESS * perimeter**2:
            continue
        (x, y), (width, height), angle = cv2.fitEllipse(contour)
        if abs(np.pi / 4 * width * height - area) < MAXIMUM_MISFIT * area:
            # A contour runs through the centres of a blob's outermost pixels, half a pixel inside.
            ellipses.append((x, y, (width + 1) / 2, (height + 1) / 2, np.deg2rad(angle)))
    return dots_from_ellipses(*np.reshape(ellipses, (-1, 5)).T)


def _identified(image: np.ndarray, candidates: Dots, settings: DetectorSettings) -> list[Target]:
    """Return the targets among the candidates, those without a code word as undecoded."""
    dots = candidates
    for _ in range(2):
        dots, fits = refined(image, dots)
        dots = dots.chosen(fits)
    lengths, angles = semi_axes(dots)
    code_family = family(settings.family)
    surrounded, words, certainties = _read(image, dots, code_family)
    of_size = (settings.min_radius <= lengths[:, 0]) & (lengths[:, 0] <= settings.max_radius)
    targets = []
    for i in np.flatnonzero(of_size & surrounded):
        number = code_family.number(int(words[i])) if certainties[i] > 0 else None
        xx, xy, yx, yy = dots.covariances[i].ravel().tolist()
        target = Target(
            id=UNDECODED,
            code=0,
            x=float(dots.centres[i, 0]),
            y=float(dots.centres[i, 1]),
            semi_major=float(lengths[i, 0]),
            semi_minor=float(lengths[i, 1]),
            angle=float(angles[i]),
            confidence=0.0,
            covariance=(xx, xy, yx, yy),
        )
        if number is not None:
            code, confidence = code_family.word(number), float(certainties[i])
            target = replace(target, id=number, code=code, confidence=confidence)
        targets.append(target)
    return targets


def _read(
    image: np.ndarray, dots: Dots, code_family: Family
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the bands of n dots.

    Returns
    -------
    surrounded : ndarray of bool, shape (n,)
        Whether a gap of one colour lies round the dot, in the image.
    words : ndarray of int64, shape (n,)
        The words read, in any rotation.
    certainties : ndarray of float64, shape (n,)
        Probability that the word is right if the target is one, sectors being two gray values
        with normal errors; 0 where gap, band or margin are not those of a target.
    """
    inner, outer = code_family.band_inner, code_family.band_outer
    gap = 1 + (inner - 1) * np.array([0.4, 0.6])
    band = inner + (outer - inner) * np.array([0.3, 0.5, 0.7])
    radii = np.concatenate([[0.6], gap, band, [outer + MARGIN]])
    values = sampled(image, dots, radii, SAMPLES_PER_SECTOR * code_family.bits)
    dot, ground = np.median(values[:, 0], axis=1), np.median(values[:, 1:3], axis=(1, 2))
    contrast = np.where(dot == ground, np.inf, dot - ground)
    shares = (values - ground[:, None, None]) / contrast[:, None, None]
    surrounded = inside(dots, inner, image.shape) & _mostly_ground(shares[:, 1:3])
    means, deviation, coherence = _sectors(shares[:, 3:6].mean(axis=1), code_family.bits)
    words = (means > 0.5) @ (1 << np.arange(code_family.bits))
    odds = np.abs(2 * means - 1) / (2 * np.maximum(deviation, 0.1)[:, None] ** 2)
    certainties = np.prod(1 / (1 + np.exp(-odds)), axis=1)
    whole = inside(dots, outer, image.shape) & _mostly_ground(shares[:, 6:]) & surrounded
    whole &= (np.abs(means - 0.5).min(axis=1) > MINIMUM_CLARITY) & (coherence > MINIMUM_COHERENCE)
    return surrounded, words, np.where(whole, certainties, 0.0)


def _sectors(profiles: np.ndarray, bits: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divide the profiles of n bands into sectors at the phase of their grey gradient.

    Parameters
    ----------
    profiles : ndarray, shape (n, SAMPLES_PER_SECTOR * bits)
        0 where the band has the colour of the ground, 1 where that of the dot.
    bits : int
        Number of sectors.

    Returns
    -------
    means : ndarray, shape (n, bits)
        Mean of the middle half of each sector, counter-clockwise.
    deviation : ndarray, shape (n,)
        RMS distance of the samples there from 0 or 1, whichever is nearer to the mean.
    coherence : ndarray, shape (n,)
        1 where the gradient lies at the edges of the sectors alone, 0 where it lies anywhere.
    """
    count, samples = profiles.shape
    gradient = np.abs(profiles - np.roll(profiles, 1, axis=1))
    turn = 2 * np.pi * (np.arange(samples) - 0.5) / SAMPLES_PER_SECTOR
    resultant = gradient @ np.exp(1j * turn)
    coherence = np.abs(resultant) / np.maximum(gradient.sum(axis=1), 1e-9)
    first = np.rint(np.angle(resultant) / (2 * np.pi) * SAMPLES_PER_SECTOR).astype(int)
    quarter = SAMPLES_PER_SECTOR // 4
    middle = np.arange(quarter, SAMPLES_PER_SECTOR - quarter + 1)
    places = (np.arange(bits) * SAMPLES_PER_SECTOR)[:, None] + middle
    places = (first[:, None] + places.ravel()) % samples
    sectors = np.take_along_axis(profiles, places, axis=1).reshape(count, bits, middle.size)
    means = sectors.mean(axis=2)
    errors = sectors - (means > 0.5)[:, :, None]
    return means, np.sqrt((errors**2).mean(axis=(1, 2))), coherence


def _mostly_ground(shares: np.ndarray) -> np.ndarray:
    return (np.abs(shares) < 0.35).mean(axis=(1, 2)) > 0.85


def _settled(targets: list[Target]) -> list[Target]:
    """Return the targets with each ID left to the most certain of those that claim it."""
    settled = sorted(targets, key=lambda target: (-target.confidence, target.y, target.x))
    taken = set()
    for i, target in enumerate(settled):
        if target.id in taken:
            settled[i] = replace(target, id=UNDECODED, code=0, confidence=0.0)
        elif target.id != UNDECODED:
            taken.add(target.id)
    return settled
