"""The node `scoreboard`: how well the targets of every image were identified."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Generic, TypeVar

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.drawing import draw, summary
from ahf_ros.evaluation import FALSE, WRONG, judge, score
from ahf_ros.interchange.image_files import write_image
from ahf_ros.interchange.image_messages import decode_image
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.process import ProcessNode, run
from ahf_ros.nodes.settings import ScoreboardSettings
from ahf_ros.nodes.target_msg import identification
from ahf_ros.target import Identification, TrueTarget

Message = TypeVar('Message', Image, CodedTargetArray)

KEPT = 8
"""Number of messages that wait for what was identified in their image."""


class Recent(Generic[Message]):
    """The last messages of a topic, by their stamp."""

    def __init__(self) -> None:
        self._messages: dict[tuple[int, int], Message] = {}

    def put(self, message: Message) -> None:
        """Keep a message, and forget the oldest."""
        self._messages[_stamp(message.header)] = message
        while len(self._messages) > KEPT:
            del self._messages[next(iter(self._messages))]

    def get(self, header: Header) -> Message | None:
        """Return the message with the stamp of a header."""
        return self._messages.get(_stamp(header))


class Scoreboard(ProcessNode):
    """Compares what was identified with what is there, one line an image."""

    def __init__(self) -> None:
        super().__init__('scoreboard')
        self._settings = ParameterSettings(self, ScoreboardSettings)
        self._truths: Recent[CodedTargetArray] = Recent()
        self._images: Recent[Image] = Recent()
        self.count = 0
        self.subscribe(CodedTargetArray, 'ground_truth', self._truths.put)
        self.subscribe(CodedTargetArray, 'coded_targets', self._on_targets)
        if self._settings.current.pictures:
            self.subscribe(Image, 'image', self._images.put)

    def _on_targets(self, message: CodedTargetArray) -> None:
        settings = self._settings.current
        if settings.images and self.count >= settings.images:
            return
        truth, image = self._truths.get(message.header), self._images.get(message.header)
        # Where there is a picture of every image, one that was missed does not count.
        if truth is None or (settings.pictures and image is None):
            return
        self.count += 1
        found = identification(message)
        true = [*map(TrueTarget.of, truth.targets)]
        print(f'image {self.count}: {line(found, true)}', flush=True)
        if image is not None:
            picture = Path(settings.pictures, f'image_{self.count}.jpg')
            verdicts = zip(judge(true, found.targets), found.targets, strict=True)
            wrong = [target for verdict, target in verdicts if verdict.kind in (WRONG, FALSE)]
            write_image(picture, draw(decode_image(image), found, wrong))
        if self.count == settings.images:
            self.ended.set_result(0)


def line(found: Identification, true: Sequence[TrueTarget]) -> str:
    """Return how well the targets of an image were identified, in words."""
    figures = score(true, found.targets)
    words = [summary(found), f'{figures.wrong} wrong', f'{figures.false_positives} false']
    if figures.rmse is not None:
        words.append(f'RMSE {figures.rmse[2]:.3f} px')
    words.append(f'{found.filter.evaluations} evaluations in {found.filter.duration:.2f} s')
    return ', '.join(words)


def _stamp(header: Header) -> tuple[int, int]:
    return header.stamp.sec, header.stamp.nanosec


def main(arguments: list[str] | None = None) -> int:
    """Run the node."""
    return run(Scoreboard, arguments)


if __name__ == '__main__':
    sys.exit(main())
