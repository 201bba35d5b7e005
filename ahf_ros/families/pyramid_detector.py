"""A base class for detectors that begin with the pyramid of an image."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families.claims import reported
from ahf_ros.families.contract import ExpectingDetector
from ahf_ros.families.explained import without_targets
from ahf_ros.vision.faint import faint_parts
from ahf_ros.vision.faint_targets import with_faint_targets
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.pyramid import ImagePyramid, image_pyramid

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass(frozen=True, slots=True)
class PyramidDetector(ExpectingDetector):
    """A detector of one family of targets that is `Searching` and `Contesting`.

    Attributes
    ----------
    settings : DetectorSettings
    expected : frozenset of int
        IDs that are likely to be there. Empty: all IDs are equally likely.
    contested : bool
        Whether targets whose ID others have, too, are among the results, undecoded.
    """

    contested: bool = False
    contrast: ClassVar[int] = 1  # see `Searching`

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        check_image(image)
        return self.search(image_pyramid(as_gray(image), self.settings.max_radius, self.contrast))

    @abstractmethod
    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image; see `Searching`."""

    def in_any_contrast(
        self, pyramid: ImagePyramid, search: Callable[[ImagePyramid], list[Target]]
    ) -> list[Target]:
        """Return what a search finds in an image, and in its parts of faint contrast.

        Where there are such parts, targets that are identified are painted over before these are
        looked for: narrow rings have a faint contrast of their own, and would be read twice.
        """
        if not self.stretches:
            return search(pyramid)

        def stretched(gray: np.ndarray) -> list[Target]:
            return search(image_pyramid(gray, self.settings.max_radius, self.contrast))

        found = search(pyramid)
        if next(faint_parts(pyramid.image), None) is None:
            return found
        known = [it for it in found if it.id != UNDECODED]
        left = without_targets(pyramid.image, known, self.settings.prints)
        return with_faint_targets(left, found, stretched)

    def contesting(self) -> Self:
        """Return a detector that also returns targets that share an ID; see `Contesting`."""
        return replace(self, contested=True)

    def reported(self, found: Sequence[Target], reach: float, certain: float) -> list[Target]:
        """Return the targets to report; see `ahf_ros.families.claims.reported`."""
        everything = self.settings.report_undecoded
        return reported(found, reach, certain, everything=everything, contested=self.contested)
