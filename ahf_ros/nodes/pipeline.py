"""What the node `detector` does with an image while its parameters stay as they are."""

from __future__ import annotations

import threading
from functools import partial

import numpy as np
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.advice import Adviser
from ahf_ros.detectors import Detector, create_detector
from ahf_ros.detectors.contract import Unavailable
from ahf_ros.filtering.homomorphic import filtered
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.nodes.shortfall import Shortfall
from ahf_ros.stream import Answer, Stream

STOPPING = 'the node stops'
"""Why an image that waits is not answered."""


class Stopping(Unavailable):
    """The node stops before an image is answered."""

    def __init__(self) -> None:
        super().__init__(STOPPING)


class Pipeline:
    """A stream of images, and its answers as messages; new settings need a new pipeline.

    The event `stopping` interrupts an identification, also a search, at its next step: it raises
    `Stopping`. A `detector` replaces the one that the settings name.
    """

    def __init__(
        self,
        settings: DetectorNodeSettings,
        stopping: threading.Event,
        detector: Detector | None = None,
    ) -> None:
        self.settings = settings
        identification = settings.identification
        detector = detector or create_detector(
            identification.detector, settings=identification.detection
        )
        self._family = detector.family
        self.adviser = Adviser(identification.detection, identification.number)
        self.shortfall = Shortfall()
        self.stream: Stream[Header] = Stream(
            identification,
            settings.stacking,
            detector,
            timed=settings.queue != LOSSLESS,  # without durations, runs are byte-identical
            # No method of this object: with a cycle of references, it would stay in memory.
            interrupt=partial(_check_running, stopping),
        )

    def message(self, answer: Answer[Header]) -> CodedTargetArray:
        """Return an answer as it is sent, with the header of its last image."""
        found, header = answer.identification, answer.items[-1]
        return coded_target_array(found, self._family, answer.stack.shape, header, msg)

    def filtered(self, answer: Answer[Header]) -> np.ndarray:
        """Return the filtered image in which the targets of an answer were identified."""
        settings = self.settings.identification.adaptive.filter
        return filtered(answer.image, answer.identification.filter, settings)


def _check_running(stopping: threading.Event) -> None:
    if stopping.is_set():
        raise Stopping
