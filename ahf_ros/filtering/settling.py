"""Which families of targets images show, settled on the first of them.

All families are looked for in the first images, as received. From then on only those that were
found are looked for, and all again in an image that shows none of these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.deprecation import deprecated_arguments
from ahf_ros.filtering.identifier import Identifier, Memory
from ahf_ros.filtering.trials import Trials
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.target import UNDECODED, Identification

FIRST = 3
"""Images with targets in which all families are looked for."""

_MANY = 3  # targets of one family beside which a single one of another counts for nothing


def memory_of(families: Sequence[str]) -> Memory:
    """Return what earlier images leave that have settled these families, if there are any."""
    return Memory(families=tuple(families), shown=FIRST if families else 0)


def families_shown(keys: Iterable[tuple[str, int]]) -> set[str]:
    """Return the families that targets of some families and IDs are evidence for."""
    counts = Counter(family for family, number in set(keys) if number != UNDECODED)
    single = max(counts.values(), default=0) < _MANY
    return {family for family, count in counts.items() if count > 1 or single}


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
    *arguments, **options
        As for `Identifier`, with a detector of all families.
    families : sequence of str
        Their names.
    narrowed : callable
        From some of them to an identifier that has their detector.
    """

    def __init__(
        self,
        *arguments: Any,
        families: Sequence[str],
        narrowed: Callable[[tuple[str, ...]], Identifier],
        **options: Any,
    ) -> None:
        super().__init__(*arguments, **options)
        self._families = families
        self._narrowed = narrowed
        self._made: dict[tuple[str, ...], Identifier] = {}
        self._looked: Trials | None = None

    @deprecated_arguments(positions=('expected_targets',))
    @one_blas_thread()
    def identify(
        self, image: np.ndarray | ImageStack, *, expected_targets: int | None = None
    ) -> Identification:
        """Identify the targets of one image or stack; see `Identifier.identify`."""
        started = self._clock()
        stack = image if isinstance(image, ImageStack) else ImageStack((image,))
        known, found = self.memory.families, None
        if self.memory.shown >= FIRST:
            found = self._read(stack, known, expected_targets)
        if not (found and found.count):
            families = self._ordered({*known, *self._look(stack)})
            if not families:
                found = super().identify(stack, expected_targets=expected_targets)
                families = self._ordered(families_shown(it.key for it in found.targets))
            elif not found or families != known:
                found = self._read(stack, families, expected_targets)
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
            if shown := families_shown(target.key for target in trials.targets[plain]):
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
