"""A detector of another package, which may fail in any way and never end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from threading import Thread
from typing import Any

import numpy as np

from ahf_ros.detectors.contract import Detector
from ahf_ros.target import Target


@dataclass(frozen=True, slots=True)
class GuardedDetector:
    """A detector whose errors are all of one kind, and which has a time limit.

    Attributes
    ----------
    detector : Detector
    timeout : float
        Time that it has for an image, s. A call that takes longer is left behind in its thread,
        which cannot be stopped and ends with the process.
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

    @property
    def refine(self) -> Callable[[np.ndarray, Sequence[Target]], Sequence[Target]] | None:
        """The method of that name of the detector, if it has one."""
        return self._guarded_method('refine')

    @property
    def draft(self) -> Callable[[np.ndarray], list[Target]] | None:
        """The method of that name of the detector, if it has one."""
        return self._guarded_method('draft')

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Raises
        ------
        ValueError
            Whatever the detector raises, naming it; or if it takes longer than its time limit.
        """
        found: list[Target] = self._guarded(self.detector, image)
        return found

    def _guarded_method(self, name: str) -> Callable[..., Any] | None:
        method = getattr(self.detector, name, None)
        return method and (lambda *arguments: self._guarded(method, *arguments))

    def _guarded(self, call: Callable[..., Any], *arguments: Any) -> Any:
        outcome: Future[Any] = Future()

        def work() -> None:
            try:
                outcome.set_result(call(*arguments))
            except BaseException as error:  # it is raised again where it is waited for
                outcome.set_exception(error)

        Thread(target=work, name=f'detector {self.name}', daemon=True).start()
        wait([outcome], self.timeout)
        if not outcome.done():
            raise ValueError(
                f'detector {self.name!r} took longer than detector_timeout, {self.timeout:g} s'
            )
        error = outcome.exception()
        if error is not None:
            raise ValueError(
                f'detector {self.name!r} failed: {type(error).__name__}: {error}'
            ) from error
        return outcome.result()
