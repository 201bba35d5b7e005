"""From an image message to the message that answers it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import CompressedImage, Image

from ahf_ros.detectors import Detector, create_detector
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.interchange.image_messages import decode_compressed, decode_image
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.nodes.target_msg import coded_target_array
from ahf_ros.session import create_identifier
from ahf_ros.target import Identification

ImageMessage: TypeAlias = Image | CompressedImage
"""What images come in as."""

STOPPING = 'the node stops'
"""Why there is no answer any more."""


class Refused(Exception):
    """There is no answer for an image; the text says why."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What an image shows.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The image as received, in gray.
    identification : Identification
        What was identified in it.
    message : CodedTargetArray
        The same, to be sent.
    """

    image: np.ndarray
    identification: Identification
    message: CodedTargetArray


class Pipeline:
    """Detector and adaptive filter, as long as the settings that they are made from are in force.

    Parameters
    ----------
    settings : DetectorNodeSettings
        Of the node.
    stopping : threading.Event
        Breaks off what is going on, also a search, at its next step.
    detector : Detector, optional
        Where it is not one that the settings name.
    """

    def __init__(
        self,
        settings: DetectorNodeSettings,
        stopping: threading.Event,
        detector: Detector | None = None,
    ) -> None:
        self.settings = settings
        self._stopping = stopping
        identification = settings.identification
        self._detector = detector or create_detector(
            identification.detector, identification.detection
        )
        self._identifier = create_identifier(
            identification, self._detector, interrupt=self._check_running
        )

    def answer(self, message: ImageMessage, expected: int | None = None) -> Answer:
        """Identify the targets of an image.

        Raises
        ------
        ValueError
            If the image is not accepted.
        Refused
            If the node stops before.
        """
        image = (decode_compressed if hasattr(message, 'format') else decode_image)(message)
        identification = self._identifier.identify(image, expected)
        if self.settings.queue == LOSSLESS:
            # Without the duration, runs are byte-identical.
            used = replace(identification.filter, duration=0.0)
            identification = replace(identification, filter=used)
        sent = coded_target_array(
            identification, self._detector.family, image.shape, message.header
        )
        return Answer(image, identification, sent)

    def filtered(self, answer: Answer) -> np.ndarray:
        """Return the image in which the targets of an answer were found."""
        used = answer.identification.filter
        if not used.applied:
            return answer.image
        settings = self.settings.identification.adaptive.filter
        return HomomorphicFilter(answer.image, settings).filtered(
            used.gamma_high, used.gamma_low, used.cutoff, used.attenuation
        )

    def reset(self) -> None:
        """Forget what was learnt from earlier images."""
        self._identifier.reset()

    def _check_running(self) -> None:
        if self._stopping.is_set():
            raise Refused(STOPPING)
