"""Identification of families of several kinds, each by the detector of its kind.

What a detector takes for a target may be a part of another one: the dot of a ring may be one dot
of many. A place belongs to one target, the surer one, of equally sure ones the larger. Where all
families are looked for and one detector finds targets of its own beyond doubt, the next ones look
at an image in which these are painted over, which takes them a fraction of the time, and at its
clear contrast alone. Dots that
were found beside them are not looked for again, and those that search for dots do not look at all
where the first one left none that its targets do not explain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import hypot
from typing import ClassVar

import numpy as np

from ahf_ros.base.target import UNDECODED, DottedTarget, Prints, Target, reach_of, sorted_targets
from ahf_ros.families.claims import owners
from ahf_ros.families.contract import (
    Contesting,
    Detector,
    DetectorSettings,
    Drafter,
    EarlyStopping,
    Expecting,
    Explaining,
    Refiner,
    Searching,
    unstretched,
)
from ahf_ros.families.evidence import is_clear
from ahf_ros.families.explained import without_targets
from ahf_ros.prints.families import AUTO
from ahf_ros.vision.common_search import CommonSearch
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.pyramid import ImagePyramid, image_pyramid

_DIGITS = 2  # of a confidence, beyond which one is not surer than another


@dataclass(frozen=True, slots=True)
class SeveralDetector:
    """Identify the targets of several detectors.

    `groups` are the families of each, `narrow` is from some of all to their detector.
    """

    settings: DetectorSettings
    parts: tuple[Detector, ...]
    groups: tuple[tuple[str, ...], ...]
    narrow: Callable[[Sequence[str]], Detector]
    name: ClassVar[str] = 'several'

    @property
    def family(self) -> str:
        """The families as the settings name them."""
        return self.settings.family

    @property
    def families(self) -> tuple[str, ...]:
        """The families one by one."""
        return tuple(name for group in self.groups for name in group)

    @property
    def patience(self) -> int:
        """The longest patience; 0, for no end, where a detector has none."""
        every = [it.patience if isinstance(it, EarlyStopping) else 0 for it in self.parts]
        return max(every) if all(every) else 0

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        return self._merged(self._found(image, lambda it, shown: it(shown)))

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify targets as a call does, with rough centres where a detector is faster so."""

        def drafted(it: Detector, shown: np.ndarray) -> list[Target]:
            return it.draft(shown) if isinstance(it, Drafter) else it(shown)

        return self._merged(self._found(image, drafted))

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with the centres that the detectors of their families find."""
        found = list(targets)
        for part, families in zip(self.parts, self.groups, strict=True):
            which = [index for index, it in enumerate(found) if it.family in families]
            if which and isinstance(part, Refiner):
                moved = part.refine(image, [found[index] for index in which])
                for index, target in zip(which, moved, strict=True):
                    found[index] = target
        return found

    def expecting(self, ids: frozenset[int]) -> SeveralDetector:
        """Return a detector that knows which IDs are likely; see `Expecting`."""
        parts = [it.expecting(ids) if isinstance(it, Expecting) else it for it in self.parts]
        return replace(self, parts=tuple(parts))

    def contesting(self) -> SeveralDetector:
        """Return a detector that also returns targets that share an ID; see `Contesting`."""
        parts = [it.contesting() if isinstance(it, Contesting) else it for it in self.parts]
        return replace(self, parts=tuple(parts))

    def unstretched(self) -> SeveralDetector:
        """Return a detector for clear contrast alone; see `Stretching`."""
        return replace(self, parts=tuple(map(unstretched, self.parts)))

    def narrowed(self, families: Sequence[str]) -> Detector:
        """Return the detector of some of the families; see `Narrowing`."""
        return self.narrow(families)

    def _found(
        self, image: np.ndarray, alone: Callable[[Detector, np.ndarray], list[Target]]
    ) -> list[list[Target]]:
        """Return the targets of each detector; those that search for dots do so together."""
        check_image(image)
        shared = sum(isinstance(it, Searching) for it in self.parts) > 1
        common = CommonSearch(self.settings.radii[0], self.settings.polarities)
        pyramid: ImagePyramid | None = None
        dots: np.ndarray | None = None  # that no target explains, once these are known...
        looked = 0  # ... from edges of this contrast
        results: list[list[Target]] = []
        left = image
        for each in self.parts:
            part = each if left is image else unstretched(each)
            same = shared and isinstance(part, Searching) and part.contrast == looked
            nothing = same and left is not image and dots is not None and not len(dots)
            if nothing or left.min() == left.max():  # all that there was is painted over
                results.append([])
                continue
            if shared and isinstance(part, Searching):
                if pyramid and pyramid.contrast != part.contrast:
                    pyramid = None  # before there is another one: it takes much memory
                pyramid = pyramid or self._pyramid(left, part.contrast, common)
            if pyramid and isinstance(part, Explaining):
                (found, dots), looked = part.explain(pyramid), pyramid.contrast
                dots = None if self.settings.report_undecoded else dots
            elif pyramid and isinstance(part, Searching):
                found = part.search(pyramid)
            else:
                found = alone(part, left)
            results.append(found)
            if self.family == AUTO and is_clear(found):
                known = [it for it in found if it.id != UNDECODED]
                left, pyramid = without_targets(left, known, self.settings.prints), None
                beside = partial(_beside, targets=known, prints=self.settings.prints)
                common = common.select(beside)
                dots = dots if dots is None else dots[beside(dots)]
        return results

    def _pyramid(self, image: np.ndarray, contrast: int, common: CommonSearch) -> ImagePyramid:
        """Return the pyramid of an image, which all detectors share at its own contrast."""
        pyramid = image_pyramid(as_gray(image), self.settings.max_radius, contrast)
        return pyramid if contrast > 1 else replace(pyramid, common=common)

    def _merged(self, results: Sequence[Sequence[Target]]) -> list[Target]:
        """Return the targets of all detectors that own their places."""
        named = [
            (number, target)
            for number, found in enumerate(results)
            for target in self._named(self.groups[number], found)
        ]
        radii = [_radius(target, self.settings.prints) for _, target in named]
        order = sorted(
            range(len(named)),
            key=lambda it: (
                named[it][1].id == UNDECODED,
                -round(named[it][1].confidence, _DIGITS),
                -radii[it],
            ),
        )
        x, y = np.array([(named[it][1].x, named[it][1].y) for it in order]).reshape(-1, 2).T
        reach, of = np.array(radii)[order], np.array([named[it][0] for it in order], int)

        def rivals(some: np.ndarray) -> np.ndarray:
            away = np.hypot(x - x[some, None], y - y[some, None])
            return (away < np.maximum(reach, reach[some, None])) & (of != of[some, None])

        owning = owners(len(order), rivals)
        return sorted_targets(
            named[index][1] for index, owns in zip(order, owning, strict=True) if owns
        )

    @staticmethod
    def _named(families: Sequence[str], found: Sequence[Target]) -> Iterator[Target]:
        """Yield targets with the name of their family where the detector has a name for all."""
        for target in found:
            known = target.id == UNDECODED or target.family in families
            yield target if known else replace(target, family=families[0])


def _beside(dots: np.ndarray, targets: Sequence[Target], prints: Prints) -> np.ndarray:
    """Return which dots, by their frames (k, 3, 3), have their centres on none of some targets."""
    x, y, reach = np.array([(it.x, it.y, _radius(it, prints)) for it in targets]).T
    away = np.hypot(dots[:, :1, 2] - x, dots[:, 1, 2, None] - y)
    return np.asarray((away >= reach).all(axis=1))


def _radius(target: Target, prints: Prints) -> float:
    """Return the radius of the narrowest circle about a target's centre that ends with it."""
    if isinstance(target, DottedTarget) and target.dots:
        reach = max(hypot(x - target.x, y - target.y) for x, y, *_ in target.dots)
        return reach * target.semi_minor / target.semi_major
    return reach_of(target, prints) * target.semi_minor
