"""Detectors of other packages, which may fail in any way or never return."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from threading import Thread
from typing import Any, Protocol

import numpy as np

from ahf_ros.detectors.contract import Detector, Drafter, Expecting, Refiner
from ahf_ros.target import Target
from ahf_ros.target_check import checked_targets
from ahf_ros.text import reason_of


@dataclass(frozen=True, slots=True)
class GuardedDetector:
    """A detector with a time limit, all of whose errors are a ValueError.

    Attributes
    ----------
    detector : Detector
    timeout : float
        Time limit for one image, s. A call that takes longer goes on in its thread, which cannot
        be stopped and ends with the process.
    """

    detector: Detector
    timeout: float

    @property
    def name(self) -> str:
        """Name of the detector."""
        return self.detector.name

    @property
    def family(self) -> str:
        """Family of its targets."""
        return self.detector.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Raises
        ------
        ValueError
            Whatever the detector raises, with its name; if it exceeds its time limit or returns
            what `checked_targets` does not accept.
        """
        return self._checked(self.detector, image)

    def expecting(self, ids: frozenset[int]) -> GuardedDetector:
        """Return the same for a detector that was told the IDs, if it is `Expecting`."""
        if not isinstance(self.detector, Expecting):
            return self
        return guarded(self._guarded(self.detector.expecting, ids), self.timeout)

    def _checked(self, call: Callable[..., Any], *arguments: Any) -> list[Target]:
        return checked_targets(self._guarded(call, *arguments), f'detector {self.name!r}')

    def _guarded(self, call: Callable[..., Any], *arguments: Any) -> Any:
        outcome: Future[Any] = Future()

        def work() -> None:
            try:
                outcome.set_result(call(*arguments))
            except BaseException as error:  # raised again by the caller
                outcome.set_exception(error)

        Thread(target=work, name=f'detector {self.name}', daemon=True).start()
        wait([outcome], self.timeout)
        if not outcome.done():
            raise ValueError(
                f'detector {self.name!r} took longer than detector_timeout, {self.timeout:g} s'
            )
        error = outcome.exception()
        if error is not None:
            raise ValueError(f'detector {self.name!r} failed: {reason_of(error)}') from error
        return outcome.result()


class RefiningDetector(Detector, Refiner, Protocol):
    """A detector that is a `Refiner`."""


@dataclass(frozen=True, slots=True)
class GuardedRefiner(GuardedDetector):
    """The same for a detector that is a `Refiner`."""

    detector: RefiningDetector

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> Sequence[Target]:
        """Return targets with the centres of an image; see `Refiner`."""
        return self._checked(self.detector.refine, image, targets)

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image, if possible as a `Drafter` does."""
        if isinstance(self.detector, Drafter):
            return self._checked(self.detector.draft, image)
        return self._checked(self.detector, image)


def guarded(detector: Detector, timeout: float) -> GuardedDetector:
    """Return a detector with a time limit, in s, that is a `Refiner` if `detector` is one."""
    if isinstance(detector, Refiner):
        return GuardedRefiner(detector, timeout)
    return GuardedDetector(detector, timeout)
