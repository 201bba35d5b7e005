"""From an image message to the message that answers it."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.detectors import Detector, create_detector
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.interchange.image_messages import decode_compressed, decode_image
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.sequence import identify_parts
from ahf_ros.session import create_identifier
from ahf_ros.target import Identification

ImageMessage: TypeAlias = Image | CompressedImage
"""The messages that images arrive in."""

STOPPING = 'the node stops'
"""Why an image that waits is not answered."""


class Refused(Exception):
    """An image that cannot be answered; the text says why."""


@dataclass(frozen=True, slots=True)
class ImageAnswer:
    """An image and its identification.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The image as received, in gray.
    identification : Identification
        Its identification.
    message : CodedTargetArray
        The identification as it is sent.
    images : int
        Number of images of a stack that this is the first answer to.
    split : str
        Why a stack was split before these images; empty if it was not.
    """

    image: np.ndarray
    identification: Identification
    message: CodedTargetArray
    images: int = 1
    split: str = ''


class Pipeline:
    """Detector and adaptive filter; new settings need a new pipeline.

    Parameters
    ----------
    settings : DetectorNodeSettings
        Settings of the node.
    stopping : threading.Event
        Interrupts an identification, also a search, at its next step.
    detector : Detector, optional
        Replaces the detector that the settings name.
    """

    def __init__(
        self,
        settings: DetectorNodeSettings,
        stopping: threading.Event,
        detector: Detector | None = None,
    ) -> None:
        self.settings = settings
        identification = settings.identification
        self._detector = detector or create_detector(
            identification.detector, identification.detection
        )
        # No method of this object: with a cycle of references, it would stay in memory for long.
        interrupt = partial(_check_running, stopping)
        self._identifier = create_identifier(identification, self._detector, interrupt=interrupt)

    def answer(self, message: ImageMessage, expected: int | None = None) -> ImageAnswer:
        """Identify the targets of an image.

        Parameters
        ----------
        message : Image or CompressedImage
            The image.
        expected : int, optional
            N; that of the settings where None.

        Raises
        ------
        ValueError
            If the image is not accepted.
        Refused
            If the node stops first.
        """
        image = decoded(message)
        return self._answer(image, self._identifier.identify(image, expected), message.header)

    def answers(
        self, images: Sequence[tuple[Header, np.ndarray]], fresh: int
    ) -> Iterator[ImageAnswer]:
        """Identify the targets of a stack, and yield an answer for each of its parts.

        Parameters
        ----------
        images : sequence of tuple of Header and ndarray
            The stack. The answer to a part has the header of its last image.
        fresh : int
            How many of the last images have not been answered; parts without them are left out.

        Raises
        ------
        ValueError
            If an image is not accepted.
        Refused
            If the node stops first.
        """
        headers = [header for header, _ in images]
        parts = identify_parts(
            self._identifier,
            [image for _, image in images],
            self.settings.stacking,
            fresh=fresh,
        )
        for part, stack, found in parts:
            shown = stack.combined(found.combination)
            answer = self._answer(shown, found, headers[part.images[-1]])
            new = part.images.stop - max(part.images.start, len(images) - fresh)
            yield replace(answer, images=new, split=part.split)

    def _answer(
        self, image: np.ndarray, identification: Identification, header: Header
    ) -> ImageAnswer:
        if self.settings.queue == LOSSLESS:
            # Without the duration, runs are byte-identical.
            used = replace(identification.filter, duration=0.0)
            identification = replace(identification, filter=used)
        family, shape = self._detector.family, image.shape
        sent = coded_target_array(identification, family, shape, header, msg)
        return ImageAnswer(image, identification, sent)

    def filtered(self, answer: ImageAnswer) -> np.ndarray:
        """Return the filtered image in which the targets of an answer were identified."""
        used = answer.identification.filter
        if not used.applied:
            return answer.image
        settings = self.settings.identification.adaptive.filter
        return HomomorphicFilter(answer.image, settings).filtered(
            used.gamma_high, used.gamma_low, used.cutoff, used.attenuation
        )

    def reset(self) -> None:
        """Forget what worked for earlier images."""
        self._identifier.reset()


def decoded(message: ImageMessage) -> np.ndarray:
    """Return the image of a message, in gray.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    return (decode_compressed if hasattr(message, 'format') else decode_image)(message)


def _check_running(stopping: threading.Event) -> None:
    if stopping.is_set():
        raise Refused(STOPPING)
