"""One image or stack identified through many filters, through each of them once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import chain
from threading import Lock
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import UNDECODED, Target, count_codes, sorted_targets
from ahf_ros.base.target_check import checked_targets
from ahf_ros.identification.filtering.genes import tuned
from ahf_ros.identification.filtering.genetic import Values
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter
from ahf_ros.identification.filtering.settings import AdaptiveSettings
from ahf_ros.vision.stack import ImageStack

DetectorFunction = Callable[[np.ndarray], list[Target]]
"""From an 8-bit image, shape (height, width), to the targets in it. Called from several threads at
once where several filters are tried at a time."""

CONFIRMED = 5
"""Number of filters of a reduced image that are tried on the whole one."""

_REACH = 0.5  # semi-major axes; targets that are closer are at the same place
_MINIMUM_REACH = 2.0  # px, for dots so small that noise moves their centres further
_MINIMUM_FILTERS = 2  # that must agree on a target that the best filter does not show
_MAJORITY = 5  # times the filters that contradict a claim: five to one


class Trials:
    """The targets of one image or stack, as received and through every filter tried.

    What is tried is a tuple of values of the genes. None stands for one image as received. Of a
    stack, the last value is the number of the combination, and is alone for a combination that is
    not filtered. The detector sees what is not filtered, the draft the rest; errors call either
    `name`. With `halved`, all images are at half their size.

    Attributes
    ----------
    plain : tuple
        What is tried without a filter, the most promising first.
    found : dict
        From what was tried to its targets.
    targets : dict
        The same for the targets whose IDs are listed in the settings; all if none is.
    """

    def __init__(
        self,
        stack: ImageStack,
        detector: DetectorFunction,
        draft: DetectorFunction,
        settings: AdaptiveSettings,
        name: str,
        halved: bool = False,
    ) -> None:
        self._stack = stack
        self._several = len(stack.names) > 1
        numbers = range(len(stack.names))
        self.plain: tuple[Values | None, ...] = (
            tuple((float(number),) for number in numbers) if self._several else (None,)
        )
        self.found: dict[Values | None, list[Target]] = {}
        self.targets: dict[Values | None, list[Target]] = {}
        self._detector = detector
        self._draft = draft
        self._settings = settings
        self._listed = settings.listed
        self._name = name
        self._halved = halved
        self._lock = Lock()
        self._images: dict[int, np.ndarray] = {}
        self._prepared: dict[int, HomomorphicFilter] = {}

    def parts(self, values: Values | None) -> tuple[int, Values | None]:
        """Return the number of the combination, and the values of its filter or None."""
        if not self._several:
            return 0, values
        assert values
        return int(values[-1]), values[:-1] or None

    def suits(self, values: Values | None, genes: int) -> bool:
        """Return whether what was tried for other images can be tried for these."""
        if not values:
            return False
        return len(values) in ((1, genes + 1) if self._several else (genes,))

    def image(self, values: Values | None) -> np.ndarray:
        """Return the image, or the combination of the stack, before it is filtered."""
        number, _ = self.parts(values)
        with self._lock:
            if number not in self._images:
                image = self._stack.combined(self._stack.names[number])
                if self._halved:
                    height, width = image.shape
                    size = (max(width // 2, 1), max(height // 2, 1))
                    image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
                self._images[number] = image
            return self._images[number]

    def discrepancy(
        self, expected: int, values: Values | None, executor: Executor | None = None
    ) -> int:
        """Return |N - n| through a filter."""
        return abs(expected - self.count(values, executor))

    def count(self, values: Values | None, executor: Executor | None = None) -> int:
        """Return n through a filter; the threads of the executor share the image's strips."""
        if values not in self.targets:
            self.know(values, checked_targets(self._detected(values, executor), self._name))
        return count_codes(self.targets[values])

    def know(self, values: Values | None, found: list[Target]) -> None:
        """Note what a filter shows."""
        self.found[values] = found
        self.targets[values] = [
            target
            for target in found
            if not self._listed or target.id in self._listed or target.id == UNDECODED
        ]

    def left_out(self, values: Values | None) -> tuple[int, ...]:
        """Return the IDs that a filter showed and that are not expected."""
        shown = {target.id for target in self.found[values]}
        return tuple(sorted(shown - self._listed - {UNDECODED})) if self._listed else ()

    def reduced(self) -> Trials:
        """Return trials of all images at half their size."""
        draft = self._draft
        return Trials(self._stack, draft, draft, self._settings, self._name, halved=True)

    def _detected(self, values: Values | None, executor: Executor | None) -> Any:
        """Return what the detector finds through a filter, without a check."""
        number, chosen = self.parts(values)
        image = self.image(values)
        if self._several and image.min() == image.max():
            return []
        if chosen is None and image.dtype == np.uint8:
            return self._detector(image)
        # equal gains leave the image as it is, but for the mapping to 8 bit
        used = asdict(tuned(image.shape, chosen or (1.0, 1.0)))
        prepared = self._filter(number, image, keep=chosen is not None)
        shown = prepared.filtered(**used, executor=executor)
        del prepared  # while the detector is at work, in large images
        return self._draft(shown)

    def _filter(self, number: int, image: np.ndarray, *, keep: bool) -> HomomorphicFilter:
        """Return the filter of an image, which others of a search keep."""
        with self._lock:
            prepared = self._prepared.get(number)
            if prepared is None:
                prepared = HomomorphicFilter(image, self._settings.filter)
                if keep:
                    self._prepared[number] = prepared
            return prepared


def confirmed(
    expected: int,
    tried: Sequence[Values],
    reduced: Trials,
    whole: Trials,
    executor: Executor | None,
) -> tuple[Values, ...]:
    """Try the best filters of a reduced image on the whole one, up to the first that shows N.

    Return those tried, the best of the reduced image first.
    """
    best = sorted(tried, key=partial(reduced.discrepancy, expected))[:CONFIRMED]
    for count, values in enumerate(best, 1):
        if whole.discrepancy(expected, values, executor) == 0:
            return tuple(best[:count])
    return tuple(best)


@dataclass(slots=True)
class _Claim:
    """An ID at a place."""

    target: Target  # through the best filter that shows it
    first: int  # index of that filter
    filters: set[int] = field(default_factory=set)

    def near(self, other: Target) -> bool:
        """Return whether another target is at the same place."""
        reach = max(_REACH * self.target.semi_major, _MINIMUM_REACH)
        return bool(np.hypot(other.x - self.target.x, other.y - self.target.y) < reach)


def fused(results: Sequence[Sequence[Target]]) -> list[Target]:
    """Return the targets on which filters agree, sorted, each as the best of its filters shows it.

    The best filter for the whole image may hide a target that another one shows. If the light
    makes a detector read a wrong ID, it does so through few filters, and the wrong ID varies. A
    target counts if the best filter, the first one, or at least two others show it, and if five
    times as many filters show it as contradict it: as show, without it, another target that its
    dot overlaps, or its ID at another place. Undecoded targets are ignored.
    """
    by_print: defaultdict[tuple[str, int, int], list[_Claim]] = defaultdict(list)
    for index, targets in enumerate(results):
        for target in targets:
            if target.id == UNDECODED:
                continue
            same = [claim for claim in by_print[target.print] if claim.near(target)]
            if not same:
                same = [_Claim(target, index)]
                by_print[target.print] += same
            same[0].filters.add(index)
    claims = list(chain.from_iterable(by_print.values()))
    kept = []
    for claim, rivals in zip(claims, _rivals([claim.target for claim in claims]), strict=True):
        against = set().union(*(claims[index].filters for index in rivals)) - claim.filters
        agreed = claim.first == 0 or len(claim.filters) >= _MINIMUM_FILTERS
        if agreed and len(claim.filters) >= _MAJORITY * len(against):
            kept.append(claim.target)
    return sorted_targets(kept)


def _rivals(targets: Sequence[Target]) -> Iterator[list[int]]:
    """Yield for each target the indices of those that cannot be right with it."""
    prints = [f'{it.family} {it.id} {it.polarity}' for it in targets]
    keys = np.unique(prints, return_inverse=True)[1]
    x, y, radius = np.reshape([(it.x, it.y, it.semi_major) for it in targets], (-1, 3)).T
    for index, key in enumerate(keys):
        overlapping = np.hypot(x - x[index], y - y[index]) < radius + radius[index]
        overlapping |= keys == key
        overlapping[index] = False
        yield np.flatnonzero(overlapping).tolist()
