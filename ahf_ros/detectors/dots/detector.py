"""Identification of rings of dots that light does not break.

Discs are found as all dots are; disc and border are fitted together to a projective frame, in
which the evidence for a dot at each place of the ring gives the code word.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from ahf_ros.codes.dots import DotFamily, dot_family, smallest_bracelet
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.dots.circles import fit_targets
from ahf_ros.detectors.dots.reading import Readings, read_rings
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.dot_search import all_dots, whole_dots
from ahf_ros.features.dots import Dots, distinct
from ahf_ros.features.ellipse_targets import ellipse_fields, targets_from_frames
from ahf_ros.features.frame import affine_frames, ellipse_axes, mean_radii
from ahf_ros.features.pyramid import ImagePyramid, image_pyramid
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target, sorted_targets

CERTAIN = 0.99
"""Confidence from which a target is reported."""

_PART = 512  # discs fitted at a time, which bounds the memory
_PLAUSIBLE = 0.5  # share of the edges of disc and border, for the ring to be read
_WHOLE = 0.9  # the same, of a target that is reported without its code
_FAINTEST = 0.8  # contrast of a disc, dark over bright
_WEIGHTS = (-19.0, 18.0, 0.8, 0.6)  # of 1, share, weakest and second weakest place
_DEVIATION = (0.25, 0.02)  # usual one of the edges that costs 1 in the log-odds, px and radii
_FARTHEST, _FARTHEST_SHARE = 1.0, 0.2  # that a centre is moved by a refinement: px, radii


@dataclass(frozen=True, slots=True)
class DotsDetector:
    """Identify rings of dots.

    Attributes
    ----------
    settings : DetectorSettings

    Raises
    ------
    ValueError
        If the data file of the family is not accepted.
    """

    name: ClassVar[str] = 'dots'
    settings: DetectorSettings = field(default_factory=DetectorSettings)

    def __post_init__(self) -> None:
        """Refuse a data file that is not accepted."""
        dot_family(self.settings.family_file)

    @property
    def family(self) -> str:
        """Family of the codes."""
        return self.settings.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        check_image(image)
        settings, code = self.settings, dot_family(self.settings.family_file)
        pyramid = image_pyramid(as_gray(image), settings.max_radius)
        dots = find_discs(pyramid, settings, code)
        found: list[Target] = []
        for start in range(0, len(dots.frames), _PART):
            part = dots.select(np.s_[start : start + _PART])
            fit = fit_targets(pyramid.gray, part.frames, part.polarity, code)
            good = (fit.share >= _PLAUSIBLE) & (fit.contrast <= _FAINTEST)
            fit, polarity = fit.select(good), part.polarity[good]
            readings = read_rings(pyramid.logs[0], fit.frames, polarity, code)
            found += _targets(fit, readings, code, settings)
        found = _resolved(found, code)
        if not settings.report_undecoded:
            found = [target for target in found if target.id != UNDECODED]
        return sorted_targets(found)

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their places in an image; see `Refiner`.

        Targets whose disc and border are not found near to where they should be stay as they are.
        """
        check_image(image)
        if not targets:
            return []
        code = dot_family(self.settings.family_file)
        gray = as_gray(image).astype(np.float32, copy=False)
        columns = [(it.x, it.y, it.semi_major, it.semi_minor, it.angle) for it in targets]
        start = affine_frames(*np.array(columns).T)
        fits = [
            fit_targets(gray, start, np.full(len(start), polarity), code)
            for polarity in self.settings.polarities
        ]
        best = np.argmax([fit.share * (1 - fit.contrast) for fit in fits], axis=0)
        fit = Fit.joined(fits).select(best * len(start) + np.arange(len(start)))
        moved = np.hypot(*(fit.frames[:, :2, 2] - start[:, :2, 2]).T)
        reach = np.maximum(_FARTHEST, _FARTHEST_SHARE * ellipse_axes(start)[1])
        good = (fit.share >= _PLAUSIBLE) & (moved <= reach)
        places = ellipse_fields(fit.frames, fit.covariance)
        return [
            replace(target, **place) if is_good else target
            for target, place, is_good in zip(targets, places, good, strict=True)
        ]


def find_discs(pyramid: ImagePyramid, settings: DetectorSettings, code: DotFamily) -> Dots:
    """Return where discs may be: the dots of an image, and the middles of rings.

    Parameters
    ----------
    pyramid : ImagePyramid
    settings : DetectorSettings
    code : DotFamily
    """
    low, high = settings.radii
    found = [all_dots(pyramid, low, high, settings.polarities)]
    rings = whole_dots(pyramid, low * code.ground_radius, high * code.border_radius, (1, -1))
    for radius, side in ((code.border_radius, 1), (code.ground_radius, -1)):
        # The outer edge of the border has the polarity of the disc, the inner one the opposite.
        part = rings.select(np.isin(side * rings.polarity, settings.polarities))
        frames = part.frames.copy()
        frames[:, :2, :2] /= radius
        found.append(Dots(frames, side * part.polarity, part.share))
    return distinct(Dots.joined(found))


def _targets(
    fit: Fit, readings: Readings, code: DotFamily, settings: DetectorSettings
) -> list[Target]:
    """Return the rings with their codes, undecoded where these are not certain."""
    weakest = np.sort(np.abs(readings.evidence), axis=1)
    features = [np.ones(len(fit.share)), fit.share, weakest[:, 0], weakest[:, 1]]
    odds = np.stack(features, axis=1) @ _WEIGHTS
    size = mean_radii(fit.frames)
    odds -= (fit.deviation / (_DEVIATION[0] + _DEVIATION[1] * size)) ** 2
    confidence = 1 / (1 + np.exp(-np.clip(odds, -30, 30)))
    codes = smallest_bracelet(readings.words, code.bits)
    numbers = [code.number(int(word)) for word in codes]
    ids = np.array([UNDECODED if number is None else number for number in numbers], int)
    major = ellipse_axes(fit.frames)[0]
    minimum, maximum = settings.radii
    shown = readings.inside & (major >= minimum) & (major <= maximum)
    certain = (confidence >= CERTAIN) & (ids != UNDECODED)
    shown &= certain | (fit.share >= _WHOLE)
    ids = np.where(certain, ids, UNDECODED)
    confidence = np.where(certain, confidence, 0.0)
    return targets_from_frames(
        fit.frames[shown], fit.covariance[shown], ids[shown], codes[shown], confidence[shown]
    )


def _resolved(targets: list[Target], code: DotFamily) -> list[Target]:
    """Return one target for each place and each ID, the most certain one."""
    kept: list[Target] = []
    for target in sorted(targets, key=lambda it: (-it.confidence, it.y, it.x)):
        apart = all(
            np.hypot(it.x - target.x, it.y - target.y)
            > code.border_radius * min(it.semi_minor, target.semi_minor)
            for it in kept
        )
        if apart and (target.id == UNDECODED or all(it.id != target.id for it in kept)):
            kept.append(target)
    return kept
