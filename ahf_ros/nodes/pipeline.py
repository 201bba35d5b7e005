"""What the node `detector` does with an image while its parameters stay as they are."""

import threading
from collections import deque
from functools import partial

import numpy as np
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.base.target import Identification
from ahf_ros.base.text import counted, listed
from ahf_ros.families import Detector, create_detector
from ahf_ros.families.contract import Unavailable
from ahf_ros.files.target_messages import coded_target_array, unanswered
from ahf_ros.identification.filtering.homomorphic import filtered
from ahf_ros.identification.stream import Answer, Stream
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.settings import LOSSLESS, DetectorNodeSettings
from ahf_ros.views.advice import Adviser

IN_A_ROW = 10
"""Images with n other than N after which it is said."""


class Shortfall:
    """Looks at the identifications of a stream; `line` says what is wrong with the last ones.

    Only an N that was given counts, by a number or by IDs: an estimate is nobody's mistake.
    """

    def __init__(self) -> None:
        self.line = ''
        self._in_a_row = 0
        self._last: deque[Identification] = deque(maxlen=IN_A_ROW)

    def see(self, found: Identification) -> None:
        """Take note of the next identification."""
        if not found.expected or found.estimated or found.count == found.expected:
            self._in_a_row, self.line = 0, ''
            self._last.clear()
            return
        self._in_a_row += 1
        self._last.append(found)
        if len(self._last) == IN_A_ROW:
            self.line = f'{self._in_a_row} images in a row {_of(tuple(self._last))}'


def _of(last: tuple[Identification, ...]) -> str:
    """Return what images show in place of what was expected, and a remedy."""
    expected, ids = last[-1].expected, last[-1].expected_ids
    counts = sorted({found.count for found in last})
    if ids:
        others = sorted({number for found in last for number in found.other_ids})
        seen = {target.id for found in last for target in found}
        missing = [str(number) for number in ids if number not in seen]
        if others and counts == [0] and not last[-1].mirrored:
            return (
                f'show IDs {listed([*map(str, others)])} and none of expected_ids: set '
                'expected_ids to those of the targets that are there'
            )
        if missing and counts != [0]:
            return (
                f'lack IDs {listed(missing)} of expected_ids: leave out of expected_ids what is '
                'not in view, or set network_ids to all if images show some of them'
            )
    if counts == [0]:
        return (
            f'show no target, N is {expected}: family, polarity, min_radius and max_radius say '
            'what is looked for'
        )
    name = 'expected_ids' if ids else 'expected_targets'
    fewest = f'{counts[0]} to ' if len(counts) > 1 else ''
    shown = f'{fewest}{counted(counts[-1], "target")}'
    return f'show {shown}, N is {expected}: set {name} to what is in view'


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
        return coded_target_array(
            answer.identification,
            self._family,
            answer.stack.shape,
            answer.items[-1],
            msg,
            reason=answer.note,
            settled=answer.settled,
        )

    def unanswered(self, header: Header, status: str, reason: str) -> CodedTargetArray:
        """Return what is sent of an image that was not identified."""
        return unanswered(status, reason, self._family, header, msg)

    def filtered(self, answer: Answer[Header]) -> np.ndarray:
        """Return the filtered image in which the targets of an answer were identified."""
        settings = self.settings.identification.adaptive.filter
        return filtered(answer.image, answer.identification.filter, settings)


def _check_running(stopping: threading.Event) -> None:
    if stopping.is_set():
        raise Stopping
