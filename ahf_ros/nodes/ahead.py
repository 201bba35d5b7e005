"""The next image identified while the current one is, without any effect on the answers."""

from __future__ import annotations

import threading

from ahf_ros.nodes.pipeline import ImageAnswer, ImageMessage, Pipeline, Speculation
from ahf_ros.nodes.waiting import Take


class ImageJob:
    """An image that waits for its answer, which may be prepared before its turn.

    Parameters
    ----------
    take : callable
        Returns the message; called once.
    pipeline : Pipeline
        Makes the answer.
    """

    def __init__(self, take: Take, pipeline: Pipeline) -> None:
        self._take = take
        self._pipeline = pipeline
        self._lock = threading.Lock()
        self._begun = False
        self._message: ImageMessage | None = None
        self._speculation: Speculation | None = None

    def prepare(self) -> None:
        """Identify the targets of the image, unless it is its turn already."""
        with self._lock:
            if not self._begun:
                self._message = self._take()
                self._speculation = self._pipeline.speculation(self._message)

    def outdated(self) -> bool:
        """Return whether the image has been prepared in vain; waits for a preparation."""
        with self._lock:
            self._begun = True
        prepared = self._message is not None
        return prepared and not self._pipeline.holds(self._speculation)

    def answer(self) -> ImageAnswer:
        """Return the answer, in its turn.

        Raises
        ------
        ValueError
            If the image is not accepted.
        Refused
            If the node stops first.
        """
        with self._lock:
            self._begun = True
        message, self._message = self._message or self._take(), None
        speculation, self._speculation = self._speculation, None
        return self._pipeline.answer(message, speculation=speculation)
