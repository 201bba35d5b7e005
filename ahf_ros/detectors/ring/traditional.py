"""Traditional identification: threshold, contours, gates, ellipse fit, grey gradient of the band.

This is the identification "TI" that the paper [1]_ drives beside Agisoft Metashape: an adaptive
threshold, contours whose perimeter and roundness are those of a dot, a least-squares ellipse, and
the coded band read by its grey gradient in the affine frame of that ellipse. It has no defence of
its own against uneven light, which makes it the fair test of a filter that has.

Beyond the paper, the edges of dot and band are measured at sub-pixel accuracy, and together give
the image of the physical centre of a decoded target; that of an undecoded one is the centre of its
ellipse, with the perspective bias in it (0.03 px for a dot of 20 px radius at 45 degrees).

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.features.circle_fit import dot_circles, fit_circles, ring_circles
from ahf_ros.features.frame import affine_frames, circle_points, ellipse_axes, project, sample
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target

THRESHOLD_WINDOW = 80
"""Side of the square in which the threshold lies halfway from darkest to brightest, px."""

MINIMUM_CONTRAST = 20
"""Least difference of those two for there to be anything, gray values of 8 bit."""

REDUCTION = 4
"""The darkest and the brightest are looked for in an image reduced by this."""

MINIMUM_ROUNDNESS = 0.4
"""Smallest 4 pi area / perimeter^2 of a dot; a circle seen at 70 degrees has 0.67, at 78 0.45."""

MAXIMUM_MISFIT = 0.12
"""Largest relative difference between the area of a contour and that of its ellipse."""

RAYS = 48
"""Directions in which the edge of a dot is measured."""

REACH = 0.45
"""Distance on either side over which an edge is looked for, dot radii: less than half a gap."""

MINIMUM_SHARE = 0.75
"""Smallest share of its edges that a dot shows in their place."""

SAMPLES_PER_SECTOR = 12
"""Directions in which the band of a target is sampled, per sector of the code."""

MARGIN = 0.5
"""Distance from the band at which the margin of a target is tested, in radii of the dot."""

LEVEL = 0.4
"""Where ground ends and dot begins, from the ground, 0, to the dot, 1.

Less than a half, because the gap shows the ground in all directions, the darkest included, but the
dot shows its colour in one place only.
"""

MINIMUM_CLARITY = 0.15
"""Least distance of a sector's mean from `LEVEL`."""

MINIMUM_COHERENCE = 0.6
"""Least agreement of the band's grey gradient with one division into sectors, 0 to 1."""

CONTOUR_ERROR = 1.0
"""Standard deviation of the centre of a contour, px."""

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

    @property
    def name(self) -> str:
        """Name in the registry."""
        return 'traditional'

    @property
    def family(self) -> str:
        """Family of the codes."""
        return self.settings.family

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
            If `image` is not an image, see `ahf_ros.imaging.image.check_image`.
        """
        return self._targets(image, fine=True)

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image, centres being those of contours, to about a pixel.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)

        Returns
        -------
        list of Target
            As a call returns it, in less than half of the time.
        """
        return self._targets(image, fine=False)

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their places in an image; see `refine_centres`."""
        wanted = self.settings
        return refine_centres(image, targets, family(wanted.family), wanted.signs)

    def _targets(self, image: np.ndarray, fine: bool) -> list[Target]:
        check_image(image)
        found: list[Target] = []
        gray = as_gray(image).astype(np.float32, copy=False)
        for sign, mask in _masks(_eight_bit(image), self.settings.polarity):
            candidates = _candidates(mask, self.settings)
            for start in range(0, len(candidates), CHUNK):
                chunk = candidates[start : start + CHUNK]
                found += _identified(gray, chunk, sign, self.settings, fine)
        targets = _settled(found, family(self.settings.family))
        if not self.settings.report_undecoded:
            targets = [target for target in targets if target.id != UNDECODED]
        return sorted(targets, key=lambda target: (target.id, target.y, target.x))


def _eight_bit(image: np.ndarray) -> np.ndarray:
    if image.dtype == np.uint8:
        return image
    scaled = np.empty(image.shape, np.uint8)
    return cv2.normalize(image, scaled, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)


def _masks(gray: np.ndarray, polarity: str) -> Iterator[tuple[int, np.ndarray]]:
    """Yield -1 and the mask of the dark pixels of an 8-bit image, 1 and that of the bright ones.

    The threshold is Bernsen's, halfway between the extremes of the neighbourhood.
    """
    height, width = gray.shape
    size = (-(-width // REDUCTION), -(-height // REDUCTION))
    reduced = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    window = (THRESHOLD_WINDOW // REDUCTION,) * 2
    kernel = np.ones(window, np.uint8)
    darkest, brightest = (
        cv2.blur(extreme(reduced, kernel), window, borderType=cv2.BORDER_REPLICATE)
        for extreme in (cv2.erode, cv2.dilate)
    )
    middle = cv2.addWeighted(darkest, 0.5, brightest, 0.5, 0)
    flat = cv2.subtract(brightest, darkest) < MINIMUM_CONTRAST
    smooth = cv2.blur(gray, (3, 3))
    for sign, name, unreachable in ((-1, 'dark', 0), (1, 'bright', 255)):
        if polarity in ('auto', name):
            threshold = np.where(flat, np.uint8(unreachable), middle)
            threshold = cv2.resize(threshold, (width, height), interpolation=cv2.INTER_LINEAR)
            comparison = cv2.CMP_LT if sign < 0 else cv2.CMP_GT
            mask = cv2.compare(smooth, threshold, comparison)
            yield sign, cv2.medianBlur(cv2.medianBlur(mask, 3), 3)


def _candidates(mask: np.ndarray, settings: DetectorSettings) -> np.ndarray:
    """Return the frames of the blobs that pass the gates of a dot."""
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
    return affine_frames(*np.reshape(ellipses, (-1, 5)).T)


def _identified(
    gray: np.ndarray, candidates: np.ndarray, sign: int, settings: DetectorSettings, fine: bool
) -> list[Target]:
    """Return the targets among the candidates, those without a code word as undecoded."""
    signs = np.full(len(candidates), -sign)
    frames = candidates
    covariances = np.broadcast_to(CONTOUR_ERROR**2 * np.eye(2), (len(frames), 2, 2))
    if fine:
        fit = fit_circles(gray, frames, dot_circles(signs, RAYS), reach=REACH, projective=False)
        fit = fit.chosen(fit.share >= MINIMUM_SHARE)
        frames, covariances = fit.frames, fit.covariance
    if not len(frames):
        return []
    code_family = family(settings.family)
    surrounded, words, starts, certainties = _read(gray, frames, sign, code_family)
    numbers = [
        code_family.number(int(word)) if certainty else None
        for word, certainty in zip(words, certainties, strict=True)
    ]
    if fine:
        decoded = np.array([i for i, number in enumerate(numbers) if number is not None], int)
        polarity = signs[decoded]
        circles = ring_circles(words[decoded], starts[decoded], polarity, RAYS, 10, code_family)
        joint = fit_circles(gray, frames[decoded], circles, reach=REACH, projective=True)
        fits = joint.share >= MINIMUM_SHARE
        frames[decoded[fits]] = joint.frames[fits]
        covariances[decoded[fits]] = joint.covariance[fits]
    semi_major, semi_minor, angles = ellipse_axes(frames)
    of_size = (settings.min_radius <= semi_major) & (semi_major <= settings.max_radius)
    return [
        Target(
            id=UNDECODED if number is None else number,
            code=0 if number is None else code_family.word(number),
            x=float(frames[i, 0, 2]),
            y=float(frames[i, 1, 2]),
            semi_major=float(semi_major[i]),
            semi_minor=float(semi_minor[i]),
            angle=float(angles[i]),
            confidence=0.0 if number is None else float(certainties[i]),
            covariance=tuple(covariances[i].ravel().tolist()),
        )
        for i, number in enumerate(numbers)
        if of_size[i] and surrounded[i]
    ]


def _read(
    gray: np.ndarray, frames: np.ndarray, sign: int, code_family: Family
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Read the bands of k targets.

    Returns
    -------
    surrounded : ndarray of bool, shape (k,)
        Whether a gap of one colour lies round the dot, in the image.
    words : ndarray of int64, shape (k,)
        The words read, in any rotation.
    starts : ndarray of float64, shape (k,)
        Where the sector of the lowest bit starts, rad counter-clockwise from +x of the frame.
    certainties : ndarray of float64, shape (k,)
        Probability that the word is right if the target is one, sectors being two gray values
        with normal errors; 0 where gap, band or margin are not those of a target.
    """
    inner, outer = code_family.band_inner, code_family.band_outer
    gap = 1 + (inner - 1) * np.array([0.4, 0.6])
    band = inner + (outer - inner) * np.array([0.3, 0.5, 0.7])
    radii = np.concatenate([[0.6], gap, band, [outer + MARGIN]])
    samples = SAMPLES_PER_SECTOR * code_family.bits
    angles = -2 * np.pi * np.arange(samples) / samples  # counter-clockwise, y pointing down
    pixels = project(frames, circle_points(angles, radii))
    values = sign * sample(gray, pixels)
    last = np.array(gray.shape[::-1]) - 1
    inside = np.all((pixels >= 0) & (pixels <= last), axis=(1, 3))

    dot = np.percentile(values[..., 0], 10, axis=1)
    ground = np.percentile(values[..., 1:3], 90, axis=(1, 2))
    contrast = np.where(dot > ground, dot - ground, np.inf)
    shares = (values - ground[:, None, None]) / contrast[:, None, None]
    surrounded = (dot > ground) & inside[:, 2]
    whole = surrounded & inside[:, 5] & ((shares[..., 6] < LEVEL).mean(axis=1) > 0.85)
    profiles = np.clip(4 * (shares[..., 3:6].mean(axis=2) - LEVEL) + 0.5, 0, 1)
    means, starts, deviation, coherence = _sectors(profiles, code_family.bits)
    words = (means > 0.5) @ (1 << np.arange(code_family.bits))
    odds = np.abs(2 * means - 1) / (2 * np.maximum(deviation, 0.1)[:, None] ** 2)
    certainties = np.prod(1 / (1 + np.exp(-odds)), axis=1)
    whole &= (np.abs(means - 0.5).min(axis=1) > MINIMUM_CLARITY) & (coherence > MINIMUM_COHERENCE)
    return surrounded, words, starts, np.where(whole, certainties, 0.0)


def _sectors(profiles: np.ndarray, bits: int) -> tuple[np.ndarray, ...]:
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
    starts : ndarray, shape (n,)
        Where the first sector starts, rad counter-clockwise.
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
    deviation = np.sqrt((errors**2).mean(axis=(1, 2)))
    return means, 2 * np.pi * first / samples, deviation, coherence


def _settled(targets: list[Target], code_family: Family) -> list[Target]:
    """Return the targets with each ID left to the most certain of those that claim it.

    Undecoded blobs in the band of a decoded target are its sectors, and left out.
    """
    settled: dict[int, Target] = {}
    contested, others = [], []
    for target in sorted(targets, key=lambda target: (-target.confidence, target.y, target.x)):
        if target.id == UNDECODED:
            others.append(target)
        elif target.id in settled:
            contested.append(replace(target, id=UNDECODED, code=0, confidence=0.0))
        else:
            settled[target.id] = target
    read = [*settled.values(), *contested]
    centres = np.array([(target.x, target.y) for target in read]).reshape(-1, 2)
    reach = np.array([code_family.band_outer * target.semi_major for target in read])
    for target in others:
        distances = np.hypot(centres[:, 0] - target.x, centres[:, 1] - target.y)
        if (distances > reach).all():
            read.append(target)
    return read
