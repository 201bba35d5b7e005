"""What several detectors identify in the same images: a line for each, and one picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sensor_msgs.msg import Image

from ahf_ros.drawing.colours import (
    DECODED_COLOUR,
    MISSED_COLOUR,
    TEXT_COLOUR,
    WRONG_COLOUR,
)
from ahf_ros.drawing.overlay import overlay
from ahf_ros.drawing.tiles import Tile, side_by_side
from ahf_ros.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.interchange.image_files import write_image
from ahf_ros.interchange.image_messages import decode_image
from ahf_ros.interchange.target_messages import identification_from
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.scoreboard import Truths, line, method
from ahf_ros.target import Identification, Target, TrueTarget

WIDTH = 800
"""Width of one of the images side by side, px."""


@dataclass
class Case:
    """What has come in so far about one scene, however often it is published."""

    truth: tuple[Target, ...]
    images: dict[str, np.ndarray] = field(default_factory=dict)
    answers: dict[str, Identification] = field(default_factory=dict)


class Comparison(ProcessNode):
    """Waits until every detector has identified every scene, each at its own pace.

    The scenes are published over and over again, and the first answer of a detector to a scene
    counts. So nothing depends on which images a detector has no time for.

    Parameters
    ----------
    titles : mapping of str to str
        What to call each detector, by its namespace.
    scenes : int
        Number of scenes after which the node ends.
    folder : str
        Where to write the pictures.
    origin : str
        Title of the image as received.
    """

    def __init__(self, titles: Mapping[str, str], scenes: int, folder: str, origin: str) -> None:
        super().__init__('comparison')
        self._titles = titles
        self._scenes = scenes
        self._folder = Path(folder)
        self._origin = origin
        self._truths = Truths()
        self._cases: dict[tuple[Target, ...], Case] = {}
        self.answered = 0
        self._complete: set[tuple[Target, ...]] = set()
        self.subscribe(CodedTargetArray, 'ground_truth', self._truths.put, lossless=True)
        self.subscribe(Image, 'image', partial(self._take, self._keep_image, ''))
        for space in titles:
            filtered, targets = f'{space}/detector/filtered_image', f'{space}/coded_targets'
            keep_answer = partial(self._take, self._keep_answer, space)
            self.subscribe(Image, filtered, partial(self._take, self._keep_image, space))
            # With the latest answer only, the first one to a scene may not be seen.
            self.subscribe(CodedTargetArray, targets, keep_answer, lossless=True)

    def connected(self) -> bool:
        """Return whether somebody publishes on every topic that the node listens to."""
        return all(self.count_publishers(item.topic_name) for item in self.subscriptions)

    def _take(self, keep: Callable[[Case, str, Any], None], space: str, message: Any) -> None:
        """Keep what a message says about its scene, unless the scene is done."""
        truth = self._truths.get(message.header)
        if truth is None or truth in self._complete:
            return
        case = self._cases.setdefault(truth, Case(truth))
        keep(case, space, message)
        if len(case.images) > len(self._titles) and len(case.answers) == len(self._titles):
            self._complete.add(truth)
            self._show(self._cases.pop(truth))

    def _keep_image(self, case: Case, space: str, message: Image) -> None:
        if space not in case.images:
            case.images[space] = decode_image(message)

    def _keep_answer(self, case: Case, space: str, message: CodedTargetArray) -> None:
        self.answered += 1
        case.answers.setdefault(space, identification_from(message))

    def _show(self, case: Case) -> None:
        """Print a line for each detector and write the picture of a scene."""
        number = len(self._complete)
        print(f'image {number}', flush=True)
        width = max(map(len, self._titles.values()))
        for space, title in self._titles.items():
            print(f'  {title:{width}}  {line(case.answers[space], case.truth)}', flush=True)
        picture = self._folder / f'image_{number}.jpg'
        write_image(picture, self._picture(case))
        print(f'  {picture}', flush=True)
        if number == self._scenes:
            self.ended.set_result(0)

    def _picture(self, case: Case) -> np.ndarray:
        """Return the image as received and what each detector saw in it, in two columns."""
        targets = (f'{len(case.truth)} targets', TEXT_COLOUR)
        tiles = [Tile(case.images[''], self._origin, [targets])]
        for space, name in self._titles.items():
            answer = case.answers[space]
            title = f'{name}: {method(answer)}'
            tiles.append(tile(title, case.images[space], answer, case.truth))
        return side_by_side([tiles[start : start + 2] for start in range(0, len(tiles), 2)], WIDTH)


def tile(title: str, image: np.ndarray, answer: Identification, truth: tuple[Target, ...]) -> Tile:
    """Return the overlay of an answer; right, wrong and missed targets have different colours.

    Parameters
    ----------
    title : str
        Line above it.
    image : ndarray, shape (height, width)
        The image in which the targets were identified, filtered or not.
    answer : Identification
        What was identified.
    truth : tuple of Target
        What the image shows.
    """
    verdicts = judge([TrueTarget.of(target) for target in truth], answer.targets)
    wrong = [
        target
        for verdict, target in zip(verdicts, answer.targets, strict=True)
        if verdict.kind in (WRONG, FALSE)
    ]
    met = {verdict.target for verdict in verdicts}
    missed = [target for target in truth if TrueTarget.of(target) not in met]
    remarks = [
        (f'{sum(verdict.kind == RIGHT for verdict in verdicts)} right', DECODED_COLOUR),
        (f'{len(wrong)} wrong', WRONG_COLOUR),
        (f'{len(missed)} missed', MISSED_COLOUR),
    ]
    unit = max(1, image.shape[1] // WIDTH)
    return Tile(overlay(image, answer.targets, wrong, missed, unit), title, remarks)
