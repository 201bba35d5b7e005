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

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.claims import best_targets
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.circles import REACH, target_circles
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.detectors.traditional.blobs import blob_frames, masks
from ahf_ros.detectors.traditional.grey_gradient import BandReadings, read_by_gradient
from ahf_ros.features.circle_fit import Fit, fit_circles, fit_dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.frame import ellipse_axes
from ahf_ros.imaging.image import as_gray, check_image, stretched_to_8_bit
from ahf_ros.target import UNDECODED, Target, sorted_targets

_RAYS = 48  # directions in which the edge of a dot is measured
_SAMPLES = 10  # points on each edge of the band, a sector
_MINIMUM_SHARE = 0.75  # of its edges, that a dot shows in their place
_CONTOUR_ERROR = 1.0  # standard deviation of the centre of a contour, px
_PART = 1024  # dots measured at a time, which bounds the memory


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
    codes = code.words[np.maximum(ids, 1) - 1]
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
