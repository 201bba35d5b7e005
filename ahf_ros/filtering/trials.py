"""One image or stack identified through many filters, through each of them once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from functools import partial
from threading import Lock
from typing import Any

import cv2
import numpy as np

from ahf_ros.filtering.chromosome import Values
from ahf_ros.filtering.genes import tuned
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.filtering.settings import FilterSettings
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.target import UNDECODED, Target, count_codes
from ahf_ros.target_check import checked_targets

DetectorFunction = Callable[[np.ndarray], list[Target]]
"""From an 8-bit image, shape (height, width), to the targets in it. Called from several threads at
once where several filters are tried at a time."""

CONFIRMED = 5
"""Number of filters of a reduced image that are tried on the whole one."""


class Trials:
    """The targets of one image or stack, as received and through every filter tried.

    What is tried is a tuple of values of the genes. None stands for one image as received. Of a
    stack, the last value is the number of the combination, and is alone for a combination that is
    not filtered.

    Parameters
    ----------
    stack : ImageStack
        The images as received, or one.
    detector : callable
        For images as received, and combinations of them.
    draft : callable
        For filtered ones.
    listed : frozenset of int
        The IDs that are searched for, others are left out; empty if all are.
    settings : FilterSettings
    name : str
        What errors call the detector.
    halved : bool
        Whether all images are at half their size.

    Attributes
    ----------
    plain : tuple
        What is tried without a filter, the most promising first.
    targets : dict
        From what was tried to its targets.
    others : dict
        The same for the targets whose IDs are not listed.
    """

    def __init__(
        self,
        stack: ImageStack,
        detector: DetectorFunction,
        draft: DetectorFunction,
        listed: frozenset[int],
        settings: FilterSettings,
        name: str,
        halved: bool = False,
    ) -> None:
        self._stack = stack
        self._several = len(stack.names) > 1
        numbers = range(len(stack.names))
        self.plain: tuple[Values | None, ...] = (
            tuple((float(number),) for number in numbers) if self._several else (None,)
        )
        self._listed = listed
        self.targets: dict[Values | None, list[Target]] = {}
        self.others: dict[Values | None, list[Target]] = {}
        self._detector = detector
        self._draft = draft
        self._settings = settings
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
            return self._combined(number)

    def discrepancy(
        self, expected: int, values: Values | None, executor: Executor | None = None
    ) -> int:
        """Return |N - n| through a filter."""
        return abs(expected - self.count(values, executor))

    def count(self, values: Values | None, executor: Executor | None = None) -> int:
        """Return n through a filter."""
        if values not in self.targets:
            found = checked_targets(self._found(values, executor), self._name)
            wanted = self._listed | {UNDECODED}
            listed, others = found, []
            if self._listed:
                listed = [target for target in found if target.id in wanted]
                others = [target for target in found if target.id not in wanted]
            self.others[values], self.targets[values] = others, listed
        return count_codes(self.targets[values])

    def reduced(self) -> Trials:
        """Return trials of all images at half their size."""
        draft, listed, settings = self._draft, self._listed, self._settings
        return Trials(self._stack, draft, draft, listed, settings, self._name, halved=True)

    def of(self, tried: Sequence[Values | None]) -> list[list[Target]]:
        """Return what each filter showed; one that is listed twice counts once."""
        return [self.targets[values] for values in dict.fromkeys(tried)]

    def _found(self, values: Values | None, executor: Executor | None) -> Any:
        """Return what the detector finds through a filter, listed or not, without a check."""
        number, chosen = self.parts(values)
        image = self.image(values)
        if self._several and image.min() == image.max():
            return []
        if chosen is None and image.dtype == np.uint8:
            return self._detector(image)
        with self._lock:
            if number not in self._prepared:
                self._prepared[number] = HomomorphicFilter(image, self._settings)
        # equal gains leave the image as it is, but for the mapping to 8 bit
        used = tuned(image.shape, chosen or (1.0, 1.0))
        return self._draft(
            self._prepared[number].filtered(
                used.gamma_high, used.gamma_low, used.cutoff, used.attenuation, executor
            )
        )

    def _combined(self, number: int) -> np.ndarray:
        """Return a combination, which is made once."""
        if number not in self._images:
            image = self._stack.combined(self._stack.names[number])
            if self._halved:
                height, width = image.shape
                size = (max(width // 2, 1), max(height // 2, 1))
                image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            self._images[number] = image
        return self._images[number]


def confirmed(
    expected: int,
    tried: Sequence[Values],
    reduced: Trials,
    whole: Trials,
    executor: Executor | None,
) -> tuple[Values, ...]:
    """Try the best filters of a reduced image on the whole one, up to the first that shows N.

    Parameters
    ----------
    expected : int
        N.
    tried : sequence of tuple of float
        Filters of the reduced image.
    reduced, whole : Trials
    executor : concurrent.futures.Executor or None
        Threads that share the strips of an image.

    Returns
    -------
    tuple of tuple of float
        The filters tried on the whole image, the best of the reduced one first.
    """
    best = sorted(tried, key=partial(reduced.discrepancy, expected))[:CONFIRMED]
    for count, values in enumerate(best, 1):
        if whole.discrepancy(expected, values, executor) == 0:
            return tuple(best[:count])
    return tuple(best)
