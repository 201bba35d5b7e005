"""From an image message to the message that answers it."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import count
from typing import TypeAlias

import numpy as np
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.detectors import Detector, create_detector
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.filtering.identifier import Memory
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.interchange.image_messages import decode_compressed, decode_image
from ahf_ros.interchange.target_messages import coded_target_array
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.nodes.waiting import Take
from ahf_ros.session import create_identifier
from ahf_ros.stream import identify_parts
from ahf_ros.target import Identification

ImageMessage: TypeAlias = Image | CompressedImage
"""The messages that images arrive in."""

STOPPING = 'the node stops'
"""Why an image that waits is not answered."""


class Refused(Exception):
    """An image that cannot be answered; the text says why."""


@dataclass(frozen=True)
class ImageAnswer:
    """An image or a stack, and its identification.

    Attributes
    ----------
    stack : ImageStack
        The images as received, in gray.
    identification : Identification
        Its identification.
    message : CodedTargetArray
        The identification as it is sent.
    images : int
        Number of images of a stack that this is the first answer to.
    split : str
        Why a stack was split before these images; empty if it was not.
    """

    stack: ImageStack
    identification: Identification
    message: CodedTargetArray
    images: int = 1
    split: str = ''

    @cached_property
    def image(self) -> np.ndarray:
        """The image or combination of images in which the targets were identified."""
        return self.stack.combined(self.identification.combination)


@dataclass(frozen=True)
class Speculation:
    """An identification that is right if the images before leave nothing new.

    Attributes
    ----------
    before, after : Memory
        What the images before have left, and what this one leaves.
    stack : ImageStack
        The image.
    identification : Identification
        Its identification.
    """

    before: Memory
    after: Memory
    stack: ImageStack
    identification: Identification


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

    Attributes
    ----------
    ahead : bool
        Whether there is a second thread for the next image.
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
            identification.detector, settings=identification.detection
        )
        self._stopping = stopping
        self.ahead = (identification.adaptive.threads or os.cpu_count() or 1) > 1
        # No method of this object: with a cycle of references, it would stay in memory for long.
        interrupt = partial(_check_running, stopping)
        self._identifier = create_identifier(
            detector=self._detector, settings=identification, interrupt=interrupt
        )

    def answer(
        self,
        message: ImageMessage,
        expected: int | None = None,
        speculation: Speculation | None = None,
    ) -> ImageAnswer:
        """Identify the targets of an image.

        Parameters
        ----------
        message : Image or CompressedImage
            The image.
        expected : int, optional
            N; where None, the N of the settings.
        speculation : Speculation, optional
            Of the same image, with the N of the settings; used if it is right.

        Raises
        ------
        ValueError
            If the image is not accepted.
        Refused
            If the node stops first.
        """
        identifier, header = self._identifier, message.header
        if speculation and self.holds(speculation):
            identifier.memory = speculation.after
            return self._answer(speculation.stack, speculation.identification, header)
        stack = ImageStack((decoded(message),))
        return self._answer(stack, identifier.identify(stack, expected_targets=expected), header)

    def holds(self, speculation: Speculation | None) -> bool:
        """Return whether there is a speculation that is right so far."""
        return speculation is not None and speculation.before == self._identifier.memory

    def speculation(self, message: ImageMessage) -> Speculation | None:
        """Identify the targets of an image before its turn, if one identification suffices.

        It may be called while another image is being answered. Under steady light, that image
        leaves what is there already, and the speculation is right.

        Parameters
        ----------
        message : Image or CompressedImage
            The image.

        Returns
        -------
        Speculation or None
            None if filters would have to be searched for, or if the image is not accepted.
        """
        interrupt = partial(_once, count(), self._stopping)
        identifier = create_identifier(
            detector=self._detector, settings=self.settings.identification, interrupt=interrupt
        )
        identifier.memory = before = self._identifier.memory
        try:
            stack = ImageStack((decoded(message),))
            identification = identifier.identify(stack)
        except Exception:
            # In its turn, the image is identified again, and what is wrong is reported.
            return None
        return Speculation(
            before=before, after=identifier.memory, stack=stack, identification=identification
        )

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
            answer = self._answer(stack, found, headers[part.images[-1]])
            new = part.images.stop - max(part.images.start, len(images) - fresh)
            yield replace(answer, images=new, split=part.split)

    def _answer(
        self, stack: ImageStack, identification: Identification, header: Header
    ) -> ImageAnswer:
        if self.settings.queue == LOSSLESS:
            # Without the duration, runs are byte-identical.
            used = replace(identification.filter, duration=0.0)
            identification = replace(identification, filter=used)
        family, shape = self._detector.family, stack.shape
        sent = coded_target_array(identification, family, shape, header, msg)
        return ImageAnswer(stack=stack, identification=identification, message=sent)

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


class ImageJob:
    """An image that waits for its answer, which may be prepared while the one before is answered.

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


def decoded(message: ImageMessage) -> np.ndarray:
    """Return the image of a message, in gray.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    return (decode_compressed if hasattr(message, 'format') else decode_image)(message)


def _once(calls: Iterator[int], stopping: threading.Event) -> None:
    """Raise `Refused` at every call but the first one, and when the node stops."""
    _check_running(stopping)
    if next(calls):
        raise Refused('more than one identification')


def _check_running(stopping: threading.Event) -> None:
    if stopping.is_set():
        raise Refused(STOPPING)
