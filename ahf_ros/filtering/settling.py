"""Which families of targets images show, settled on the first of them.

All families are looked for in the first images, as received. From then on only those that were
found are looked for, and all again in an image that does not clearly show one of these.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.deprecation import deprecated_arguments
from ahf_ros.filtering.identifier import Identifier, Memory
from ahf_ros.filtering.trials import DetectorFunction, Trials
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.notices import said_once
from ahf_ros.target import UNDECODED, Identification, Target

FIRST = 3
"""Images with targets in which all families are looked for."""

_OF_ONE = 2.0  # decimal logarithm of the odds on a family: one target certain to 0.99
_OF_SEVERAL = 3.9  # ... of all together: three certain to 0.95, or two to 0.989
_OF_KNOWN = 1.99  # ... on families that other images have settled: one certain to 0.99
_DOUBTFUL = 0.9  # confidence up to which words are read in nearly any texture
_CERTAIN = 1e-3  # probability that a target is wrong, below which it counts for no more


def memory_of(families: Sequence[str]) -> Memory:
    """Return what earlier images leave that have settled these families, if there are any."""
    return Memory(families=tuple(families), shown=FIRST if families else 0)


def evident(targets: Sequence[Target]) -> list[Target]:
    """Return the targets of families that they are evidence for, and undecoded ones.

    Where all families are looked for, words of some are read in nearly any texture. Most are
    doubtful, which is no evidence, and the others are few of one family: one that is certain is
    evidence, or three to 0.95. What is read in several places, as letters may
    be, counts once.
    """
    shown = {
        family
        for family, of in _evidence(targets).items()
        if max(of) > _OF_ONE or sum(of) > _OF_SEVERAL
    }
    return [it for it in targets if it.id == UNDECODED or it.family in shown]


def still_shown(targets: Sequence[Target]) -> bool:
    """Return whether an image shows families that other images have settled.

    A doubtful word may be read in a target of another family.
    """
    return any(sum(of) > _OF_KNOWN for of in _evidence(targets).values())


def _evidence(targets: Sequence[Target]) -> dict[str, list[float]]:
    """Return the decimal logarithms of the odds that targets are right, by family."""
    surest: defaultdict[tuple[str, int], float] = defaultdict(float)
    for target in targets:
        surest[target.key] = max(surest[target.key], target.confidence)
    evidence: defaultdict[str, list[float]] = defaultdict(list)
    for (family, _), confidence in surest.items():
        if confidence > _DOUBTFUL:
            evidence[family].append(-math.log10(max(1 - confidence, _CERTAIN)))
    return evidence


def _families(targets: Iterable[Target]) -> set[str]:
    return {target.family for target in targets if target.id != UNDECODED}


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
        drafted = draft and (lambda image: evident(draft(image)))
        super().__init__(
            lambda image: evident(detector(image)), *arguments, draft=drafted, **options
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
            families = self._ordered({*known, *self._look(stack)})
            if not families:
                found = super().identify(stack, expected_targets=expected_targets)
                families = self._ordered(_families(found.targets))
            elif not found or families != known:
                found = self._read(stack, families, expected_targets)
            found = replace(found, looked_for=self._looked_for)
            shown = min(self.memory.shown + (found.count > 0), FIRST)
            self.memory = replace(self.memory, families=families, shown=shown)
        self._looked = None
        state = replace(found.filter, duration=self._clock() - started)
        return replace(found, filter=state)

    def _look(self, stack: ImageStack) -> set[str]:
        """Return the families that an image shows as received, or a combination of a stack."""
        self._looked = trials = super()._trials(stack)
        for plain in trials.plain:
            trials.count(plain)
            if shown := _families(trials.targets[plain]):
                return shown
        return set()

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
