"""Traditional identification: threshold, contours, gates, ellipse fit, grey gradient of the band.

This is the identification "TI" that the paper [1]_ uses beside Agisoft Metashape: an adaptive
threshold, contours with the perimeter and roundness of a dot, a least-squares ellipse, and
the coded band read by its grey gradient in the affine frame of that ellipse. Its contours have no
defence against uneven light, which makes it a fair test of a filter.

Beyond the paper, the ellipse of a dot is measured at sub-pixel accuracy before the band is read,
because the contour of a dot of 10 px in a filtered image is off by a tenth of its radius. The band
is read by a level of the target's own. The edges of dot and band together give
the image of the physical centre of a decoded target. The centre of an undecoded one is the centre
of its ellipse, with the perspective bias in it (0.03 px for a dot of 20 px radius at 45 degrees).

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import cv2
import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import UNDECODED, Target, count_codes, sorted_targets
from ahf_ros.families.claims import best_targets
from ahf_ros.families.contract import DetectorSettings, FamilyDetector
from ahf_ros.families.ring.circles import REACH, target_circles
from ahf_ros.families.ring.refinement import refine_centres
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import fit_circles, fit_dots
from ahf_ros.vision.ellipse_targets import targets_from_frames
from ahf_ros.vision.frame import affine_frames, circle_points, ellipse_axes, project
from ahf_ros.vision.image import as_gray, check_image, stretched_to_8_bit
from ahf_ros.vision.logistic import probability
from ahf_ros.vision.outlines import measured
from ahf_ros.vision.sampling import sample, within

_WINDOW = 80  # side of the square in which the threshold lies between the extremes, px
_MINIMUM_CONTRAST = 20  # difference of those for there to be anything, gray values of 8 bit
_REDUCTION = 4  # of the image in which the extremes are looked for
_MINIMUM_ROUNDNESS = 0.4  # 4 pi area / perimeter^2; a circle at 70 degrees has 0.67, at 78 0.45
_MAXIMUM_MISFIT = 0.12  # between the areas of a contour and of its ellipse, relative
_MINIMUM_PERIMETER = 5.0  # points of a contour, which an ellipse takes
_CHORD = 2.0  # points of a contour in a radius of the smallest dot, also at steep views
_SLACK = 2.0  # radius of a contour over the largest of a dot, px

_RAYS = 48  # directions in which the edge of a dot is measured
_SAMPLES = 10  # points on each edge of the band, a sector
_MINIMUM_SHARE = 0.75  # of its edges, that a dot shows in their place
_MINIMUM_PLACED = 0.85  # the same of a decoded target, with the edges of its band
_THIN = 3.0  # width of a band, px, whose edges are too close to each other to be measured
_PART = 1024  # dots measured at a time, which bounds the memory

_DIRECTIONS = 12  # in which a sector is sampled
_DOT_RADII = (0.35, 0.65)  # where the dot is read, dot radii
_GAP_DEPTHS = (0.35, 0.65)  # shares of the width of the gap, where it is read
_BAND_DEPTHS = (0.3, 0.5, 0.7)  # shares of the width of the band, where it is read
_MARGIN = 0.3  # distance from the band at which the margin of a target is read, dot radii
_EXTREME = 85  # percentile of the readings that is the darkest ground, or the lightest ink
_LEVEL = 0.1  # of the way from the ground to the ink of the dot
_MINIMUM_LEVEL = 0.04  # of the contrast of dot and gap, where the light leaves less
_STEEPNESS = 10.0  # of the profile about that level, 1/contrast
_MINIMUM_STEP = 6.0  # contrast of dot and gap, gray values of 8 bit
_MINIMUM_CLARITY = 0.15  # distance of a sector's mean from the level halfway
_MINIMUM_COHERENCE = 0.5  # agreement of the grey gradient with one division into sectors, 0 to 1
_NO_GRADIENT = 1e-9  # instead of a sum of none
_MINIMUM_DEVIATION = 0.1  # of samples from 0 or 1, from which certainties are computed


def masks(gray: np.ndarray, polarities: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Yield 1 and the mask of the dark pixels of an image, then -1 and of the bright ones.

    The threshold is Bernsen's, halfway between the extremes of the neighbourhood. The image is
    uint8; only the given polarities are looked at.
    """
    height, width = gray.shape
    size = (-(-width // _REDUCTION), -(-height // _REDUCTION))
    reduced = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    window = (_WINDOW // _REDUCTION,) * 2
    kernel = np.ones(window, np.uint8)
    darkest, brightest = (
        cv2.blur(extreme(reduced, kernel), window, borderType=cv2.BORDER_REPLICATE)
        for extreme in (cv2.erode, cv2.dilate)
    )
    middle = cv2.addWeighted(darkest, 0.5, brightest, 0.5, 0)
    flat = cv2.subtract(brightest, darkest) < _MINIMUM_CONTRAST
    smooth = cv2.blur(gray, (3, 3))
    for polarity in polarities:
        unreachable, comparison = (0, cv2.CMP_LT) if polarity > 0 else (255, cv2.CMP_GT)
        threshold = np.where(flat, np.uint8(unreachable), middle)
        threshold = cv2.resize(threshold, (width, height), interpolation=cv2.INTER_LINEAR)
        mask = cv2.compare(smooth, threshold, comparison)
        yield polarity, cv2.medianBlur(cv2.medianBlur(mask, 3), 3)


def blob_frames(mask: np.ndarray, min_radius: float, max_radius: float) -> np.ndarray:
    """Return the frames of the blobs with the perimeter, roundness and ellipse of a dot.

    They are known to about a pixel, as are the radii of the dots, px.
    """
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    shortest = max(_MINIMUM_PERIMETER, _CHORD * min_radius)
    longest = 2 * np.pi * (max_radius + _SLACK)
    parents = hierarchy[0, :, 3].tolist() if contours else []
    outlines = [
        contour
        for contour, parent in zip(contours, parents, strict=True)
        if parent < 0 and shortest <= contour.shape[0] <= longest
    ]
    areas, perimeters, _ = measured(outlines)
    areas = np.abs(areas)
    which = np.flatnonzero(4 * np.pi * areas >= _MINIMUM_ROUNDNESS * perimeters**2)
    ellipses = [cv2.fitEllipse(outlines[index]) for index in which]
    columns = [(*centre, *axes, angle) for centre, axes, angle in ellipses]
    x, y, width, height, angle = np.reshape(columns, (-1, 5)).T
    good = np.abs(np.pi / 4 * width * height - areas[which]) < _MAXIMUM_MISFIT * areas[which]
    # A contour runs through the centres of a blob's outermost pixels, half a pixel inside.
    return affine_frames(x, y, (width + 1) / 2, (height + 1) / 2, np.deg2rad(angle))[good]


@dataclass(frozen=True, slots=True)
class TraditionalDetector(FamilyDetector):
    """The detector `traditional`; call it with an image."""

    name: ClassVar[str] = 'traditional'

    @property
    def design(self) -> RingPrint:
        """Words and radii of the family."""
        return self.settings.codes(RingPrint)[0]

    @one_blas_thread()
    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Of several targets that claim one ID the most certain keeps it, the others are undecoded.
        The threshold sees the image scaled to 8 bit, extremes to 0 and 255; edges and bands are
        measured in the image as it is.
        """
        check_image(image)
        settings = self.settings
        gray = as_gray(image).astype(np.float32, copy=False)
        colours: list[list[Target]] = []
        for polarity, mask in masks(stretched_to_8_bit(image), settings.polarities):
            frames = blob_frames(mask, *settings.radii)
            colours.append([])
            for start in range(0, len(frames), _PART):
                part = frames[start : start + _PART]
                colours[-1] += _identify_dots(gray, part, polarity, settings)
        most = max(map(count_codes, colours))
        targets = [it for found in colours if count_codes(found) == most for it in found]
        targets = _resolve(targets, self.design)
        if not settings.report_undecoded:
            targets = [target for target in targets if target.id != UNDECODED]
        return sorted_targets(targets)

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their centres in an image; see `refine_centres`."""
        return refine_centres(image, targets, (self.design,), self.settings.polarities)


def _identify_dots(
    gray: np.ndarray, frames: np.ndarray, polarity: int, settings: DetectorSettings
) -> list[Target]:
    """Return the targets among dots, undecoded where they have no code word."""
    code = settings.codes(RingPrint)[0]
    signs = np.full(len(frames), polarity)
    fit = fit_dots(gray, frames, signs, rays=_RAYS, reach=REACH)
    fit = fit.select(fit.share >= _MINIMUM_SHARE)
    if not len(fit.frames):
        return []
    readings = _read_by_level(gray, fit.frames, polarity, code)
    ids = np.where(readings.certainty > 0, code.ids(readings.words), 0)
    ids[ids == 0] = UNDECODED
    decoded = np.flatnonzero(ids != UNDECODED)
    read, dots = readings.select(decoded), fit.select(decoded)
    circles = target_circles(read.words, read.starts, dots.polarity, _SAMPLES, code)
    joint = fit_circles(gray, dots.frames, circles, reach=REACH, projective=True)
    good = joint.share >= _MINIMUM_PLACED
    fit = fit.replaced(decoded[good], joint.select(good))
    _, minor, _ = ellipse_axes(dots.frames)
    thin = minor * (code.band_outer - code.band_inner) < _THIN
    ids[decoded[~good & ~thin]] = UNDECODED
    major, _, _ = ellipse_axes(fit.frames)
    minimum, maximum = settings.radii
    shown = (minimum <= major) & (major <= maximum)
    shown &= (ids != UNDECODED) | (settings.report_undecoded & readings.surrounded)
    confidence = np.where(ids == UNDECODED, 0.0, readings.certainty)
    codes = code.canonical(readings.words)
    return targets_from_frames(
        fit.frames[shown],
        fit.covariance[shown],
        ids[shown],
        codes[shown],
        confidence[shown],
        code.name,
    )


def _resolve(targets: list[Target], code: RingPrint) -> list[Target]:
    """Return the targets with each ID left to the most certain of those that claim it.

    Undecoded blobs in the band of a decoded target are its sectors and are dropped.
    """
    read = [it for it in targets if it.id != UNDECODED]
    x, y, major = np.array([(it.x, it.y, it.semi_major) for it in read]).reshape(-1, 3).T
    best = set(best_targets(read))
    return [
        it
        if it.id == UNDECODED or it in best
        else replace(it, id=UNDECODED, code=0, confidence=0.0)
        for it in targets
        if it.id != UNDECODED or (np.hypot(x - it.x, y - it.y) > code.band_outer * major).all()
    ]


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


def _read_by_level(
    gray: np.ndarray, frames: np.ndarray, polarity: int, code: RingPrint
) -> BandReadings:
    """Read the bands of targets of one polarity: ink is what is darker than their darkest ground.

    Light that changes across a target may make its ink as bright here as its ground is elsewhere,
    but gap and margin show how dark the ground of this target gets.
    """
    inner, outer = code.band_inner, code.band_outer
    gap = 1 + (inner - 1) * np.array(_GAP_DEPTHS)
    band = inner + (outer - inner) * np.array(_BAND_DEPTHS)
    angles = -2 * np.pi * np.arange(_DIRECTIONS * code.bits) / (_DIRECTIONS * code.bits)
    radii = np.concatenate([_DOT_RADII, gap, band, [outer + _MARGIN]])
    pixels = project(frames, circle_points(angles, radii))
    values = -polarity * sample(gray, pixels)  # the larger, the more like the dot
    of_dot, of_gap, of_band, of_margin = np.split(
        values, np.cumsum([len(_DOT_RADII), len(gap), len(band)]), axis=2
    )
    inside = np.all(within(pixels, gray.shape), axis=1)
    dot, around, margin = (of.mean(axis=2) for of in (of_dot, of_gap, of_margin))

    ink = np.percentile(dot, 100 - _EXTREME, axis=1)
    surrounded = ink > np.percentile(around, _EXTREME, axis=1)
    surrounded &= inside[:, : len(_DOT_RADII) + len(gap)].all(axis=1)
    ground = np.percentile(np.hstack([around, margin]), _EXTREME, axis=1)
    contrast = np.median(dot - around, axis=1)
    clear = inside.all(axis=1) & (contrast > _MINIMUM_STEP)
    level = ground + np.maximum(_LEVEL * (ink - ground), _MINIMUM_LEVEL * contrast)
    scale = np.where(clear, contrast, np.inf)[:, None, None]
    profiles = (of_band - level[:, None, None]) / scale
    profiles = np.clip(_STEEPNESS * profiles + 0.5, 0, 1).mean(axis=2)
    means, starts, deviation, coherence = _sectors(profiles, code.bits)
    words = (means > 0.5) @ (1 << np.arange(code.bits))
    spread = np.maximum(deviation, _MINIMUM_DEVIATION)[:, None]
    odds = np.abs(2 * means - 1) / (2 * spread**2)
    certainty = np.prod(probability(odds), axis=1)
    whole = clear & (np.abs(means - 0.5).min(axis=1) > _MINIMUM_CLARITY)
    whole &= coherence > _MINIMUM_COHERENCE
    certainty = np.where(whole, certainty, 0.0)
    return BandReadings(surrounded=surrounded, words=words, starts=starts, certainty=certainty)


def _sectors(profiles: np.ndarray, bits: int) -> tuple[np.ndarray, ...]:
    """Divide the profiles of n bands into sectors at the phase of their grey gradient.

    Profiles, shape (n, _DIRECTIONS * bits), are 0 where the band has the colour of the ground, 1
    where it has the dot's.

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
    gradient = (profiles - np.roll(profiles, 1, axis=1)) ** 2  # whole steps, not noise
    turn = 2 * np.pi * (np.arange(samples) - 0.5) / _DIRECTIONS
    resultant = gradient @ np.exp(1j * turn)
    coherence = np.abs(resultant) / np.maximum(gradient.sum(axis=1), _NO_GRADIENT)
    first = np.rint(np.angle(resultant) / (2 * np.pi) * _DIRECTIONS).astype(int)
    quarter = _DIRECTIONS // 4
    middle = np.arange(quarter, _DIRECTIONS - quarter + 1)
    angles = (np.arange(bits) * _DIRECTIONS)[:, None] + middle
    angles = (first[:, None] + angles.ravel()) % samples
    sectors = np.take_along_axis(profiles, angles, axis=1).reshape(count, bits, middle.size)
    means = sectors.mean(axis=2)
    errors = sectors - (means > 0.5)[:, :, None]
    deviation = np.sqrt((errors**2).mean(axis=(1, 2)))
    return means, 2 * np.pi * first / samples, deviation, coherence
