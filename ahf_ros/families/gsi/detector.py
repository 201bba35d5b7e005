"""Identification of point-distributed targets that light does not break.

Dots are found as blobs, as whole outlines, and as points that many gradients of the logarithm of
the image point away from. Groups of them that look like the template give homographies; each is
judged by the evidence at all places of the printed design, where there should be a dot as well as
where there should be none, so that neither a mirror image nor a chance arrangement is taken for a
target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import cv2
import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import UNDECODED, DottedTarget, Target, sorted_targets
from ahf_ros.families.contract import DetectorSettings, moved_targets
from ahf_ros.families.gsi.evidence import find_evidence, likely_templates, read_codes
from ahf_ros.families.gsi.grouping import FEW, Templates, find_templates
from ahf_ros.families.gsi.hypotheses import (
    CERTAIN,
    NO_HYPOTHESES,
    OBVIOUS,
    POSSIBLE,
    SAME,
    Hypotheses,
    confidence_features,
    inside,
    least_support,
    plausible,
    resolve,
    strays,
)
from ahf_ros.families.gsi.refinement import (
    Placement,
    dot_frames,
    measure_dots,
    place_targets,
    resized,
)
from ahf_ros.families.pyramid_detector import PyramidDetector
from ahf_ros.families.undecoded import undecoded
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.vision import frame
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.dots import Dots, distinct
from ahf_ros.vision.ellipse_targets import ellipse_fields, frames_of, stayed, targets_from_frames
from ahf_ros.vision.homography import local_frames
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.large_targets import targets_of_octaves
from ahf_ros.vision.pyramid import ImagePyramid, Octave
from ahf_ros.vision.small_dots import small_dots_in

_MARGIN = 0.4  # about dots of certain targets and dots whose outline is whole, dot radii
_PROMISING = 0.85  # support of a hypothesis with another code than before, to be placed again
_MAXIMUM_GROWTH = 1.0  # of ink, beyond which dots are printed with another radius, px


@dataclass(frozen=True, slots=True)
class GsiDetector(PyramidDetector):
    """Identify point-distributed targets: GSI's, or those that a data file describes."""

    name: ClassVar[str] = 'gsi'
    patience: ClassVar[int] = 3

    @property
    def design(self) -> PointPrint:
        """Printed design of the family."""
        return self.settings.codes(PointPrint)[0]

    @one_blas_thread()
    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image; see `Searching`."""
        found = self.in_any_contrast(pyramid, self._of_pyramid)
        single = [target for target in found if target.id == UNDECODED]
        coded = [target for target in found if target.id != UNDECODED]
        reach = SAME * self.design.reach / float(self.design.template_radii[self.design.reference])
        coded = self.reported(coded, reach, CERTAIN)
        return sorted_targets([*coded, *map(undecoded, single)])

    def _of_pyramid(self, pyramid: ImagePyramid) -> list[Target]:
        """Return what a pyramid shows, some of it twice."""
        return targets_of_octaves(pyramid, self.settings.radii, self._identify, self.refine)

    def _identify(self, octave: Octave) -> list[Target]:
        """Return the targets of an octave, in its pixels."""
        low, high = octave.radii
        settings = replace(self.settings, min_radius=low, max_radius=high)
        code = self.design
        hypotheses, dots = find_hypotheses(octave.pyramid, settings, code, self.expected)
        minimum = POSSIBLE if settings.report_undecoded else CERTAIN
        targets: list[Target] = [*likely_targets(hypotheses, code, minimum)]
        if settings.report_undecoded:
            targets += uncoded(octave.pyramid.gray, dots, targets, settings)
        return targets

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their places in an image; see `Refiner`.

        Targets other than `DottedTarget`, and those whose dots are not found near to where they
        should be, stay as they are.
        """
        check_image(image)
        code = self.design
        dotted = [it for it in targets if isinstance(it, DottedTarget) and it.id != UNDECODED]
        if not dotted:
            return list(targets)
        gray = as_gray(image).astype(np.float32, copy=False)
        words = np.array([it.code for it in dotted])
        polarity = np.array([it.polarity for it in dotted])
        ellipses = np.array([it.dots for it in dotted])
        frames = frame.affine_frames(*ellipses.reshape(-1, 5).T).reshape(*ellipses.shape[:2], 3, 3)
        placed = place_targets(gray, frames, polarity, *_printed(words, code), code.reach)
        good = stayed(placed.homographies, frames_of(dotted)) & (placed.share >= 0.5)
        return moved_targets(targets, dotted, _fields(placed, words, code), good)


def find_hypotheses(
    pyramid: ImagePyramid,
    settings: DetectorSettings,
    code: PointPrint,
    expected: frozenset[int] = frozenset(),
) -> tuple[Hypotheses, Dots]:
    """Return the groups of dots that may be targets, and all dots outside of certain targets.

    Dots whose outlines are whole cost little. Where they make obvious targets, no others are
    looked for.
    """
    kind = (*settings.radii, settings.polarities)
    # Outlines of coarser edges are too inexact for the homography of a template.
    whole = resized(pyramid.gray, whole_dots(pyramid, *kind, levels=1))
    first = read_targets(pyramid, whole, code, NO_HYPOTHESES, expected, obvious=True)
    certain = first.select(resolve(first, code, OBVIOUS))
    places, radii = _printed(certain.words, code, certain.scale)
    rest, explained = np.ones(len(whole.frames), bool), []
    for frames in dot_frames(certain.homographies, places, (1 + _MARGIN) * radii):
        rest &= ~inside(whole.frames[:, :2, 2], frames)
        corners = frame.circle_outlines(frames, np.ones(len(frames))).reshape(-1, 2)
        explained.append(cv2.convexHull(corners.astype(np.float32))[:, 0])
    dots = resized(pyramid.gray, _with_others(pyramid, whole.select(rest), settings, explained))
    return read_targets(pyramid, dots, code, certain, expected, obvious=False), dots


def _with_others(
    pyramid: ImagePyramid, whole: Dots, settings: DetectorSettings, explained: list[np.ndarray]
) -> Dots:
    """Return dots with a whole outline, and those without one outside of explained outlines."""
    outlines = frame.circle_outlines(whole.frames, np.full(len(whole.frames), 1 + _MARGIN))
    kind = (*settings.radii, settings.polarities)
    voted = voted_dots(pyramid, *kind, explained=[*outlines, *explained])
    return distinct(Dots.joined([whole, voted, small_dots_in(pyramid, *kind, explained)]))


def read_targets(
    pyramid: ImagePyramid,
    dots: Dots,
    code: PointPrint,
    known: Hypotheses,
    expected: frozenset[int] = frozenset(),
    *,
    obvious: bool,
) -> Hypotheses:
    """Return known hypotheses, and the groups of dots that may be targets, read as codes.

    The polarity with fewer dots comes first. Prints in one image are alike: if there are certain
    targets, but none of the other polarity, its dots, where they are many, are those of light.
    """
    polarities = [np.flatnonzero(dots.polarity == polarity) for polarity in (1, -1)]
    for which in sorted(polarities, key=len):
        if len(which) > FEW:
            certain = known.polarity[resolve(known, code)]
            if len(certain) and not np.isin(certain, dots.polarity[which]).any():
                continue
        some = dots.select(which)
        templates = find_templates(some, code, obvious=obvious)
        if not len(templates.polarity):
            continue
        read = _read(pyramid, some, templates, code, expected, obvious=obvious)
        known = Hypotheses.joined([known, read])
    return known


def _read(
    pyramid: ImagePyramid,
    dots: Dots,
    templates: Templates,
    code: PointPrint,
    expected: frozenset[int],
    *,
    obvious: bool,
) -> Hypotheses:
    least = least_support(obvious=obvious)
    templates, evidence = likely_templates(pyramid.logs[0], templates, code, least)
    if not len(templates.polarity):
        return NO_HYPOTHESES
    readings = read_codes(evidence, templates.scale, code, expected)
    which = plausible(templates, readings, code, obvious=obvious)
    if not len(which):
        return NO_HYPOTHESES
    words = readings.words[which]
    first = _placed(pyramid, dots, templates.select(which), words, code, expected)
    again = np.flatnonzero((first.words != words) & (first.support >= _PROMISING))
    if not len(again):
        return first
    found = first.select(again)
    return first.replaced(again, _placed(pyramid, dots, found, found.words, code, expected))


def _placed(
    pyramid: ImagePyramid,
    dots: Dots,
    groups: Templates | Hypotheses,
    words: np.ndarray,
    code: PointPrint,
    expected: frozenset[int],
) -> Hypotheses:
    """Return hypotheses with homographies through all of their dots, read once more."""
    polarity = groups.polarity
    frames = dot_frames(groups.homographies, *_printed(words, code, groups.scale))
    placement = place_targets(pyramid.gray, frames, polarity, *_printed(words, code), code.reach)
    evidence = find_evidence(
        pyramid.logs[0], placement.homographies, polarity, placement.scale, code
    )
    readings = read_codes(evidence, placement.scale, code, expected)
    stray = strays(dots, placement, *_printed(readings.words, code, placement.scale), code)
    return Hypotheses(
        homographies=placement.homographies,
        covariance=placement.covariance,
        polarity=polarity,
        scale=placement.scale,
        growth=placement.growth,
        words=readings.words,
        features=confidence_features(placement, readings, stray, code),
    )


def likely_targets(hypotheses: Hypotheses, code: PointPrint, minimum: float) -> list[DottedTarget]:
    """Return the targets whose codes have a minimum of confidence, one in each place."""
    some = hypotheses.select(resolve(hypotheses, code, minimum))
    return [
        DottedTarget(
            id=code.number(word) or 0,
            code=word,
            confidence=confidence,
            family=code.name,
            template_dots=len(code.template),
            polarity=polarity,
            **place,
        )
        for word, confidence, polarity, place in zip(
            some.words.tolist(),
            some.confidence.tolist(),
            some.polarity.tolist(),
            _fields(some, some.words, code),
            strict=True,
        )
    ]


def uncoded(
    gray: np.ndarray, dots: Dots, targets: Sequence[Target], settings: DetectorSettings
) -> list[Target]:
    """Return the dots that belong to none of the targets, as targets that are not decoded."""
    measured = measure_dots(gray, dots.frames, dots.polarity)
    frames, found = measured.frames, measured.near.copy()
    major = frame.ellipse_axes(frames)[0]
    minimum, maximum = settings.radii
    found &= (major >= minimum) & (major <= maximum)
    for target in targets:
        for x, y, radius, *_ in getattr(target, 'dots', ()):
            found &= np.hypot(frames[:, 0, 2] - x, frames[:, 1, 2] - y) > radius
    none = np.zeros(int(found.sum()), int)
    return targets_from_frames(
        frames[found], measured.covariance[found], none + UNDECODED, none, none.astype(float), ''
    )


def _printed(
    words: np.ndarray, code: PointPrint, scale: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return places and radii of the dots of k targets in the design, shapes (k, n, 2), (k, n).

    The radii are those of the image where their scale, shape (k,), is given.
    """
    count = len(code.template)
    decoding = np.nonzero(words[:, None] >> code.position_numbers & 1)[1]
    which = np.empty((len(words), count + code.rule.dots), int)
    which[:, :count] = np.arange(count)
    which[:, count:] = count + decoding.reshape(len(words), code.rule.dots)
    radii = code.radii[which]
    return code.places[which], radii if scale is None else radii * scale[:, None]


def _fields(
    placed: Placement | Hypotheses, words: np.ndarray, code: PointPrint
) -> list[dict[str, Any]]:
    """Return the fields of targets that say where they are, and where their dots are seen."""
    places, radii = _printed(words, code, placed.scale)
    own = [code.reference]
    references = local_frames(placed.homographies, places[:, own], radii[:, own])[:, 0]
    # Dots may have another radius than the design says: their size is the one that is seen.
    growth = np.where(np.abs(placed.growth) <= _MAXIMUM_GROWTH, placed.growth, np.nan)
    frames = dot_frames(placed.homographies, places, radii)
    axes = np.stack(frame.ellipse_axes(frames.reshape(-1, 3, 3)), axis=1)
    ellipses = np.concatenate([frames[..., :2, 2], axes.reshape(*radii.shape, 3)], axis=2)
    return [
        {**place, 'dots': tuple(map(tuple, of_target))}
        for place, of_target in zip(
            ellipse_fields(references, placed.covariance, growth),
            ellipses.tolist(),
            strict=True,
        )
    ]
