"""One image identified through many filters, through each of them once."""

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
from ahf_ros.filtering.homomorphic import FilterSettings, HomomorphicFilter
from ahf_ros.target import UNDECODED, Target, count_codes
from ahf_ros.target_check import checked_targets

DetectorFunction = Callable[[np.ndarray], list[Target]]
"""From an 8-bit image, shape (height, width), to the targets in it. Called from several threads at
once where several filters are tried at a time."""

CONFIRMED = 5
"""Number of filters of a reduced image that are tried on the whole one."""


class Trials:
    """The targets of one image, as received and through every filter tried.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        The image as received.
    detector : callable
        For the image as received.
    draft : callable
        For images made from it.
    listed : frozenset of int
        The IDs that are searched for, others are left out; empty if all are.
    settings : FilterSettings
    name : str
        What errors call the detector.

    Attributes
    ----------
    image
        As given.
    targets : dict
        From the values of a filter to its targets; None stands for the image as received.
    others : dict
        The same for the targets whose IDs are not listed.
    """

    def __init__(
        self,
        image: np.ndarray,
        detector: DetectorFunction,
        draft: DetectorFunction,
        listed: frozenset[int],
        settings: FilterSettings,
        name: str,
    ) -> None:
        self.image = image
        self._listed = listed
        self.targets: dict[Values | None, list[Target]] = {}
        self.others: dict[Values | None, list[Target]] = {}
        self._detector = detector
        self._draft = draft
        self._settings = settings
        self._name = name
        self._lock = Lock()
        self._prepared: HomomorphicFilter | None = None

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
        """Return trials of the image at half its size."""
        height, width = self.image.shape
        size = (max(width // 2, 1), max(height // 2, 1))
        image = cv2.resize(self.image, size, interpolation=cv2.INTER_AREA)
        listed, settings = self._listed, self._settings
        return Trials(image, self._draft, self._draft, listed, settings, self._name)

    def of(self, tried: Sequence[Values | None]) -> list[list[Target]]:
        """Return what each filter showed; one that is listed twice counts once."""
        return [self.targets[values] for values in dict.fromkeys(tried)]

    def _found(self, values: Values | None, executor: Executor | None) -> Any:
        if values is None and self.image.dtype == np.uint8:
            return self._detector(self.image)
        with self._lock:
            if self._prepared is None:
                self._prepared = HomomorphicFilter(self.image, self._settings)
        # equal gains leave the image as it is, but for the mapping to 8 bit
        chosen = tuned(self.image.shape, values or (1.0, 1.0))
        return self._draft(
            self._prepared.filtered(
                chosen.gamma_high, chosen.gamma_low, chosen.cutoff, chosen.attenuation, executor
            )
        )


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
