"""Traditional identification: threshold, contours, gates, ellipse fit, grey gradient of the band.

This is the identification "TI" that the paper [1]_ uses beside Agisoft Metashape: an adaptive
threshold, contours with the perimeter and roundness of a dot, a least-squares ellipse, and
the coded band read by its grey gradient in the affine frame of that ellipse. It has no defence
against uneven light, which makes it a fair test of a filter.

Beyond the paper, the edges of dot and band are measured at sub-pixel accuracy, and together give
the image of the physical centre of a decoded target. The centre of an undecoded one is the centre
of its ellipse, with the perspective bias in it (0.03 px for a dot of 20 px radius at 45 degrees).

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.claims import best_targets
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.circles import REACH, target_circles
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.detectors.traditional.grey_gradient import BandReadings, read_by_gradient
from ahf_ros.features.circle_fit import Fit, fit_circles, fit_dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.frame import affine_frames, ellipse_axes
from ahf_ros.imaging.image import as_gray, check_image, stretched_to_8_bit
from ahf_ros.target import UNDECODED, Target, sorted_targets

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
_CONTOUR_ERROR = 1.0  # standard deviation of the centre of a contour, px
_PART = 1024  # dots measured at a time, which bounds the memory


def masks(gray: np.ndarray, polarities: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Yield 1 and the mask of the dark pixels of an image, then -1 and of the bright ones.

    The threshold is Bernsen's, halfway between the extremes of the neighbourhood.

    Parameters
    ----------
    gray : ndarray of uint8, shape (height, width)
    polarities : sequence of int
        1 for the dark pixels, -1 for the bright ones.
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

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
        Not zero in blobs.
    min_radius, max_radius : float
        Of the dots, px.

    Returns
    -------
    ndarray of float64, shape (k, 3, 3)
        To about a pixel.
    """
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    shortest = max(_MINIMUM_PERIMETER, _CHORD * min_radius)
    longest = 2 * np.pi * (max_radius + _SLACK)
    ellipses = []
    for index, contour in enumerate(contours):
        if not shortest <= len(contour) <= longest or hierarchy[0, index, 3] >= 0:
            continue
        area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, closed=True)
        if 4 * np.pi * area < _MINIMUM_ROUNDNESS * perimeter**2:
            continue
        (x, y), (width, height), angle = cv2.fitEllipse(contour)
        if abs(np.pi / 4 * width * height - area) < _MAXIMUM_MISFIT * area:
            # A contour runs through the centres of a blob's outermost pixels, half a pixel inside.
            ellipses.append((x, y, (width + 1) / 2, (height + 1) / 2, np.deg2rad(angle)))
    return affine_frames(*np.reshape(ellipses, (-1, 5)).T)


@dataclass(frozen=True, slots=True)
class TraditionalDetector:
    """The detector `traditional`; call it with an image.

    Attributes
    ----------
    settings : DetectorSettings
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

    @one_blas_thread()
    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Of several targets that claim one ID the most certain keeps it, the others are undecoded.
        The threshold sees the image scaled to 8 bit, extremes to 0 and 255; edges and bands are
        measured in the image as it is.
        """
        return self._identify(image, fine=True)

    @one_blas_thread()
    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify in less than half of the time, with centres to about a pixel."""
        return self._identify(image, fine=False)

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their centres in an image; see `refine_centres`."""
        return refine_centres(image, targets, family(self.family), self.settings.polarities)

    def _identify(self, image: np.ndarray, fine: bool) -> list[Target]:
        check_image(image)
        settings, targets = self.settings, []
        gray = as_gray(image).astype(np.float32, copy=False)
        for polarity, mask in masks(stretched_to_8_bit(image), settings.polarities):
            frames = blob_frames(mask, *settings.radii)
            for start in range(0, len(frames), _PART):
                part = frames[start : start + _PART]
                targets += _identify_dots(gray, part, polarity, settings, fine)
        targets = _resolve(targets, family(self.family))
        if not settings.report_undecoded:
            targets = [target for target in targets if target.id != UNDECODED]
        return sorted_targets(targets)


def _identify_dots(
    gray: np.ndarray, frames: np.ndarray, polarity: int, settings: DetectorSettings, fine: bool
) -> list[Target]:
    """Return the targets among dots, undecoded where they have no code word."""
    covariance = np.broadcast_to(_CONTOUR_ERROR**2 * np.eye(2), (len(frames), 2, 2))
    code = family(settings.family)
    if fine:
        fit = fit_dots(gray, frames, np.full(len(frames), polarity), rays=_RAYS, reach=REACH)
        fit = fit.select(fit.share >= _MINIMUM_SHARE)
        frames, covariance = fit.frames, fit.covariance
    if not len(frames):
        return []
    readings = read_by_gradient(gray, frames, polarity, code)
    ids = np.array(
        [
            (code.number(int(word)) if certainty else None) or UNDECODED
            for word, certainty in zip(readings.words, readings.certainty, strict=True)
        ]
    )
    if fine:
        fit = _fit_decoded(gray, fit, readings, np.flatnonzero(ids != UNDECODED), code)
        frames, covariance = fit.frames, fit.covariance
    major, _, _ = ellipse_axes(frames)
    minimum, maximum = settings.radii
    shown = (minimum <= major) & (major <= maximum) & readings.surrounded
    confidence = np.where(ids == UNDECODED, 0.0, readings.certainty)
    codes = code.canonical(readings.words)
    return targets_from_frames(
        frames[shown], covariance[shown], ids[shown], codes[shown], confidence[shown], code.name
    )


def _fit_decoded(
    gray: np.ndarray, fit: Fit, readings: BandReadings, decoded: np.ndarray, code: Family
) -> Fit:
    """Return fits of dots, of decoded targets with their bands."""
    read, dots = readings.select(decoded), fit.select(decoded)
    circles = target_circles(read.words, read.starts, dots.polarity, _SAMPLES, code)
    joint = fit_circles(gray, dots.frames, circles, reach=REACH, projective=True)
    good = joint.share >= _MINIMUM_SHARE
    return fit.replaced(decoded[good], joint.select(good))


def _resolve(targets: list[Target], code: Family) -> list[Target]:
    """Return the targets with each ID left to the most certain of those that claim it.

    Undecoded blobs in the band of a decoded target are its sectors and are dropped.
    """
    read = [it for it in targets if it.id != UNDECODED]
    x, y, major = np.array([(it.x, it.y, it.semi_major) for it in read]).reshape(-1, 3).T
    best = set(best_targets(read))
    return [
        it if it in best else replace(it, id=UNDECODED, code=0, confidence=0.0)
        for it in targets
        if it.id != UNDECODED or (np.hypot(x - it.x, y - it.y) > code.band_outer * major).all()
    ]
