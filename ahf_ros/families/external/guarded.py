"""Detectors of other packages, which may fail in any way or never return."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from threading import Thread
from typing import Any, Protocol, TypeVar

import numpy as np

from ahf_ros.base import ending
from ahf_ros.base.target import Target
from ahf_ros.base.target_check import checked_targets, checked_text
from ahf_ros.base.text import reason_of
from ahf_ros.families.contract import Detector, Drafter, Expecting, Refiner

Result = TypeVar('Result')


@dataclass(frozen=True, slots=True)
class GuardedDetector:
    """A detector with a time limit, all of whose errors are a ValueError; `guarded` makes it.

    A call that takes longer than the limit, s, goes on in its thread, which cannot be stopped and
    ends with the process.
    """

    detector: Detector
    timeout: float
    name: str
    family: str

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; the detector gets a copy of it. See `Detector`.

        Raises
        ------
        ValueError
            Whatever the detector raises, with its name; if it exceeds its time limit or returns
            what `checked_targets` does not accept; if this process ends meanwhile.
        """
        return self._targets(self.detector, image)

    def expecting(self, ids: frozenset[int]) -> GuardedDetector:
        """Return the same for a detector that was told the IDs, if it is `Expecting`."""

        def told() -> GuardedDetector:
            if not isinstance(self.detector, Expecting):
                return self
            return guarded(self._of(self.detector.expecting, ids), self.timeout)

        return self._awaited(told)

    def _targets(self, call: Callable[..., Any], image: np.ndarray, *more: Any) -> list[Target]:
        copied = image.copy()
        return self._awaited(lambda: checked_targets(self._of(call, copied, *more), self._title))

    def _of(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Return what the detector returns, or raise a ValueError with its name."""
        try:
            return call(*arguments)
        except BaseException as error:
            raise ValueError(f'{self._title} failed: {reason_of(error)}') from error

    def _awaited(self, work: Callable[[], Result]) -> Result:
        """Return the result of work in a thread, within the time limit."""
        outcome: Future[Result] = Future()
        name = f'detector {self.name}'
        Thread(target=self._run, args=(work, outcome), name=name, daemon=True).start()
        limit = time.monotonic() + self.timeout
        while not outcome.done() and not ending.has_begun():
            remaining = limit - time.monotonic()
            if remaining <= 0:
                raise ValueError(
                    f'{self._title} took longer than detector_timeout, {self.timeout:g} s'
                )
            wait([outcome], min(ending.POLL, remaining))
        if not outcome.done():
            raise ValueError(f'{self._title} was ended with this process')
        try:
            return outcome.result()
        finally:
            del outcome  # an exception holds this frame: no cycle of references, with images

    def _run(self, work: Callable[[], Result], outcome: Future[Result]) -> None:
        try:
            outcome.set_result(work())
        except ValueError as error:
            outcome.set_exception(error)
        except BaseException as error:  # what is returned may raise anything, too
            failure = ValueError(f'{self._title} failed: {reason_of(error)}')
            failure.__cause__ = error
            outcome.set_exception(failure)
            del failure
        finally:
            del outcome

    @property
    def _title(self) -> str:
        return f'detector {self.name!r}'


class RefiningDetector(Detector, Refiner, Protocol):
    """A detector that is a `Refiner`."""


@dataclass(frozen=True, slots=True)
class GuardedRefiner(GuardedDetector):
    """The same for a detector that is a `Refiner`."""

    detector: RefiningDetector

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> Sequence[Target]:
        """Return targets with the centres of an image; see `Refiner`."""
        return self._targets(self.detector.refine, image, targets)

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image, if possible as a `Drafter` does."""

        def drafted(copied: np.ndarray) -> list[Target]:
            called = self.detector
            return called.draft(copied) if isinstance(called, Drafter) else called(copied)

        return self._targets(drafted, image)


def guarded(detector: Detector, timeout: float) -> GuardedDetector:
    """Return a detector with a time limit, in s, that is a `Refiner` if `detector` is one.

    A ValueError says if its name or its family is not a printable text.
    """
    try:
        name, family = (checked_text(getattr(detector, it), it) for it in ('name', 'family'))
        if isinstance(detector, Refiner):
            return GuardedRefiner(detector, timeout, name, family)
    except ValueError:
        raise
    except Exception as error:  # attributes of a foreign object may raise anything
        raise ValueError(f'name or family cannot be read: {reason_of(error)}') from error
    return GuardedDetector(detector, timeout, name, family)
