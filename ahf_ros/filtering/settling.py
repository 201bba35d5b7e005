"""Which families of targets images show, settled on the first of them.

All families are looked for in the first images, as received. From then on only those that were
found are looked for, and all again in an image that does not clearly show one of these.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from itertools import chain
from typing import Any

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.deprecation import deprecated_arguments
from ahf_ros.filtering.identifier import Identifier, Memory
from ahf_ros.filtering.trials import DetectorFunction, Trials
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.notices import said_once
from ahf_ros.target import UNDECODED, Identification, Target, UndecodedTarget

FIRST = 3
"""Images with targets in which all families are looked for."""

_OF_ONE = 2.0  # decimal logarithm of the odds on a family: one target certain to 0.99
_OF_SEVERAL = 3.6  # ... of all together: three certain to 0.94, or two to 0.984
_PER_IMAGE = 0.3  # words that texture shows by chance in an image, at the most
_OF_KNOWN = 1.99  # ... on families that other images have settled: one certain to 0.99
_DOUBTFUL = 0.9  # confidence up to which words are read in nearly any texture
_CERTAIN = 1e-3  # probability that a target is wrong, below which it counts for no more

Reading = tuple[str, int, float]
"""Family, ID and confidence of a target."""


def memory_of(families: Sequence[str]) -> Memory:
    """Return what earlier images leave that have settled these families, if there are any."""
    return Memory(families=tuple(families), shown=FIRST if families else 0)


def evident(targets: Sequence[Target]) -> list[Target]:
    """Return the targets of families that they are evidence for, and undecoded ones.

    Where all families are looked for, words of some are read in nearly any texture. Most are
    doubtful, which is no evidence, and the others are few of one family: one that is certain is
    evidence, or three to 0.94. What is read in several places, as letters may
    be, counts once.
    """
    shown = {
        family
        for family, of in _evidence(map(_reading, targets)).items()
        if max(of) > _OF_ONE or sum(of) > _OF_SEVERAL
    }
    return [it for it in targets if it.id == UNDECODED or it.family in shown]


def marked(targets: Sequence[Target]) -> list[Target]:
    """Return targets, those of families that they are no evidence for undecoded."""
    settled = evident(targets)
    return [it if it in settled else _unsettled(it) for it in targets]


def _unsettled(target: Target) -> UndecodedTarget:
    known: dict[str, Any] = {of.name: getattr(target, of.name) for of in fields(Target)}
    known |= {'id': UNDECODED, 'code': 0, 'family': ''}
    return UndecodedTarget(
        **known, reason='unsettled', likely_id=target.id, likely_family=target.family
    )


def evident_together(images: Sequence[Iterable[Reading]]) -> set[str]:
    """Return the families that images show together, though perhaps none of them alone.

    Of each image, all that was read in it counts, whether it was reported or not. Texture shows a
    word now and then: the more images there are, the more of them it takes, or the surer ones. An
    ID counts once, as the same texture may be in several images.

    Examples
    --------
    >>> single = [[('metashape12', number, 0.98)] for number in (15, 17, 22)]
    >>> evident_together(single), evident_together(single[:1])
    ({'metashape12'}, set())
    """
    by_chance = max(math.log10(_PER_IMAGE * len(images)), 0.0) if images else 0.0
    return {
        family
        for family, of in _evidence(chain.from_iterable(images)).items()
        if sum(max(odds - by_chance, 0.0) for odds in of) > _OF_SEVERAL
    }


def still_shown(targets: Sequence[Target]) -> bool:
    """Return whether an image shows families that other images have settled.

    A doubtful word may be read in a target of another family.
    """
    return any(sum(of) > _OF_KNOWN for of in _evidence(map(_reading, targets)).values())


def _reading(target: Target) -> Reading:
    return target.family, target.id, target.confidence


def _evidence(readings: Iterable[Reading]) -> dict[str, list[float]]:
    """Return the decimal logarithms of the odds that readings are right, by family."""
    surest: defaultdict[tuple[str, int], float] = defaultdict(float)
    for family, number, confidence in readings:
        if number != UNDECODED:
            surest[family, number] = max(surest[family, number], confidence)
    evidence: defaultdict[str, list[float]] = defaultdict(list)
    for (family, _), confidence in surest.items():
        if confidence > _DOUBTFUL:
            evidence[family].append(-math.log10(max(1 - confidence, _CERTAIN)))
    return evidence


def _families(targets: Iterable[Target]) -> set[str]:
    return {target.family for target in targets if target.id != UNDECODED}


def _beside(
    seen: Iterable[Target], found: Sequence[Target], families: Collection[str]
) -> Iterator[UndecodedTarget]:
    """Yield what was seen of other families than those that are read, and where none is found."""
    for it in seen:
        if isinstance(it, UndecodedTarget) and it.is_unsettled:
            near = any(math.hypot(it.x - of.x, it.y - of.y) < of.semi_major for of in found)
            if it.likely_family not in families and not near:
                yield it


def families_line(families: Iterable[str]) -> str:
    """Return what is said of the families that are there."""
    return f'families: {", ".join(families)}'


def settled_families(memory: Memory, before: Sequence[str]) -> str:
    """Return a line if an image has settled the families, or changed them from `before`."""
    if not memory.families or memory.families == before:
        return ''
    return families_line(memory.families)


class SettlingIdentifier(Identifier):
    """Identifies targets of all families in the first images, and then of those that were there.

    Parameters
    ----------
    detector, *arguments, draft, **options
        As for `Identifier`, with a detector of all families.
    families : sequence of str
        Their names.
    narrowed : callable
        From some of them to an identifier that has their detector.
    """

    def __init__(
        self,
        detector: DetectorFunction,
        *arguments: Any,
        draft: DetectorFunction | None = None,
        families: Sequence[str],
        narrowed: Callable[[tuple[str, ...]], Identifier],
        **options: Any,
    ) -> None:
        drafted = draft and (lambda image: marked(draft(image)))
        super().__init__(
            lambda image: marked(detector(image)), *arguments, draft=drafted, **options
        )
        self._families = families
        self._narrowed = narrowed
        self._made: dict[tuple[str, ...], Identifier] = {}
        self._looked: Trials | None = None

    @deprecated_arguments(positions=('expected_targets',))
    @one_blas_thread()
    @said_once()
    def identify(
        self, image: np.ndarray | ImageStack, *, expected_targets: int | None = None
    ) -> Identification:
        """Identify the targets of one image or stack; see `Identifier.identify`."""
        started = self._clock()
        stack = image if isinstance(image, ImageStack) else ImageStack((image,))
        known, found = self.memory.families, None
        if self.memory.shown >= FIRST:
            found = self._read(stack, known, expected_targets)
        if not (found and still_shown(found.targets)):
            seen = self._look(stack)
            families = self._ordered({*known, *_families(seen)})
            if not families:
                found = super().identify(stack, expected_targets=expected_targets)
                families = self._ordered(_families(found.targets))
            elif not found or families != known:
                found = self._read(stack, families, expected_targets)
            unsettled = tuple(_beside(seen, found.targets, families))
            found = replace(found, looked_for=self._looked_for, unsettled=unsettled)
            shown = min(self.memory.shown + (found.count > 0), FIRST)
            self.memory = replace(self.memory, families=families, shown=shown)
        self._looked = None
        state = replace(found.filter, duration=self._clock() - started)
        return replace(found, filter=state)

    def _look(self, stack: ImageStack) -> list[Target]:
        """Return what an image shows as received, or the first combination that shows a target."""
        self._looked = trials = super()._trials(stack)
        for plain in trials.plain:
            if trials.count(plain):
                return trials.targets[plain]
        return trials.targets[trials.plain[0]]

    def _trials(self, stack: ImageStack) -> Trials:
        """Return what is known of an image or stack that was looked at."""
        return self._looked or super()._trials(stack)

    def _read(
        self, stack: ImageStack, families: tuple[str, ...], expected: int | None
    ) -> Identification:
        """Return what an image shows of some families, and remember it."""
        if families not in self._made:
            self._made[families] = self._narrowed(families)
        identifier = self._made[families]
        identifier.memory = self.memory
        found = identifier.identify(stack, expected_targets=expected)
        self.memory, self.last_search = identifier.memory, identifier.last_search
        return found

    def _ordered(self, families: set[str]) -> tuple[str, ...]:
        """Return families in one order, whatever images they come from."""
        return tuple(name for name in self._families if name in families)
