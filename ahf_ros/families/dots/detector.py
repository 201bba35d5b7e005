"""Identification of rings of dots that light does not break.

Discs are found as all dots are, and by their borders; disc and border are fitted together to a
projective frame, in which the evidence for a dot at each place of the ring gives the code word.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import DottedTarget, Target, sorted_targets
from ahf_ros.families.contract import DetectorSettings, moved_targets
from ahf_ros.families.dots.calibration import stated
from ahf_ros.families.dots.discs import judged, small_discs, voted_discs, whole_discs
from ahf_ros.families.dots.rings import (
    CERTAIN,
    PLAUSIBLE,
    Rings,
    fit_targets,
    likely_targets,
    read_discs,
)
from ahf_ros.families.pyramid_detector import PyramidDetector
from ahf_ros.prints.dots import DotRingPrint
from ahf_ros.vision.ellipse_targets import ellipse_fields, frames_of, stayed
from ahf_ros.vision.frame import affine_frames, ellipse_axes
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.large_targets import targets_of_octaves
from ahf_ros.vision.pyramid import ImagePyramid, Octave


@dataclass(frozen=True, slots=True)
class DotsDetector(PyramidDetector):
    """Identify rings of dots."""

    name: ClassVar[str] = 'dots'
    patience: ClassVar[int] = 3

    @property
    def design(self) -> DotRingPrint:
        """Printed design of the family."""
        return self.settings.codes(DotRingPrint)[0]

    @one_blas_thread()
    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image; see `Searching`."""
        found = self.in_any_contrast(pyramid, self._of_pyramid)
        best = self.reported(found, self.design.border_radius, CERTAIN)
        return sorted_targets(stated(best))

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with the places that disc and border have in an image; see `Refiner`.

        Targets other than `DottedTarget`, and those whose disc and border are not found near to
        where they should be, stay as they are.
        """
        check_image(image)
        dotted = [target for target in targets if isinstance(target, DottedTarget)]
        if not dotted:
            return list(targets)
        start = frames_of(dotted)
        polarity = np.array([target.polarity for target in dotted])
        gray = as_gray(image).astype(np.float32, copy=False)
        fit = fit_targets(gray, start, polarity, self.design)
        good = (fit.share >= PLAUSIBLE) & stayed(fit.frames, start)
        changes = fit.frames @ np.linalg.inv(start)
        places = [
            {**place, 'dots': _moved(target, change)}
            for target, change, place in zip(
                dotted,
                changes,
                ellipse_fields(fit.frames, fit.covariance, fit.growth),
                strict=True,
            )
        ]
        return moved_targets(targets, dotted, places, good)

    def _of_pyramid(self, pyramid: ImagePyramid) -> list[Target]:
        """Return what a pyramid shows, some of it twice."""
        return targets_of_octaves(pyramid, self.settings.radii, self._identify, self.refine)

    def _identify(self, octave: Octave) -> list[DottedTarget]:
        """Return the targets of an octave, in its pixels."""
        low, high = octave.radii
        settings = replace(self.settings, min_radius=low, max_radius=high)
        code = self.design
        rings = find_rings(octave.pyramid, settings, code, self.expected)
        return likely_targets(rings, settings, code) if len(rings.words) else []


def find_rings(
    pyramid: ImagePyramid,
    settings: DetectorSettings,
    code: DotRingPrint,
    expected: frozenset[int] = frozenset(),
) -> Rings:
    """Return all rings of dots that an image may show, before any decision."""
    found: list[Rings] = []
    known = np.zeros((0, 3, 3))
    for search in (whole_discs, voted_discs, small_discs):
        discs = judged(pyramid, search(pyramid, settings, code, known), known, code)
        rings = read_discs(pyramid, discs, code, expected)
        known = np.concatenate([known, rings.frames[rings.of_word >= CERTAIN]])
        found.append(rings)
    return Rings.joined(found)


def _moved(target: DottedTarget, change: np.ndarray) -> tuple[Any, ...]:
    """Return the ellipses of a target after a change of its frame, shape (3, 3)."""
    frames = change @ affine_frames(*np.array(target.dots).T)
    columns = (*(frames[:, :2, 2] / frames[:, 2:, 2]).T, *ellipse_axes(frames))
    return tuple(zip(*(of.tolist() for of in columns), strict=True))
