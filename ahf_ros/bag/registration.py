"""Registration of the scans in a bag whose images are answered: clouds with their images.

It reads the finished bag alone, so that it can be done again, and takes answers and clouds through
the same functions as the nodes `detector` and `registration`.
"""

import json
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.bag.mcap_records import seconds
from ahf_ros.bag.output import answer_topic, begun_with
from ahf_ros.bag.source import Source
from ahf_ros.base import ending
from ahf_ros.base.text import counted, listed
from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.localisation import labelled
from ahf_ros.clouds.matching import ANSWER, ANSWERS, CLOUD, WAITING_MEMORY, Matcher
from ahf_ros.clouds.point_clouds import organised_points
from ahf_ros.clouds.registration_files import write_registration
from ahf_ros.clouds.registration_settings import RegistrationSettings
from ahf_ros.clouds.scans import Scans, known_targets, located, scan_cloud
from ahf_ros.files.image_messages import nanoseconds
from ahf_ros.files.target_messages import is_answered

POINT_CLOUD = 'sensor_msgs/msg/PointCloud2'


@dataclass(frozen=True, slots=True)
class RegistrationTask:
    """What is registered, and where it is written."""

    folder: Path
    cloud_topic: str = ''  # the only one if empty
    adjust: bool = False  # all scans jointly at the end
    settings: RegistrationSettings = field(default_factory=RegistrationSettings)
    cloud_settings: CloudSettings = field(default_factory=CloudSettings)


@dataclass(frozen=True, slots=True)
class Registered:
    """What became of the scans of a bag: of each, in words, and how many were refused."""

    said: tuple[str, ...]
    refused: int


def check_registration(task: RegistrationTask, source: Source, images: Collection[str]) -> None:
    """Refuse, before anything is identified, what cannot be registered."""
    if len(images) > 1:
        raise ValueError(
            f'{source.path} has images on {listed(list(images))}, accepted with register is one '
            'topic'
        )
    _cloud_topic(task, source)
    known_targets(task.settings)


def register_bag(task: RegistrationTask, bag: Path, tell: Callable[[str], None]) -> Registered:
    """Register the scans of a bag that `answer_bag` wrote, and write them.

    Equal bags give equal files, which are those of the nodes if they are given the same messages.
    `tell` is called with topic, time and reason of each scan that is refused.

    Raises
    ------
    ValueError
        If nothing is registered, or the scans cannot be adjusted.
    """
    with Source(bag) as source:
        shots = _Shots(task, source, bag, tell)
        scans = Scans(known_targets(task.settings))
        registered: set[int] = set()  # numbers of shots
        said: list[str] = []
        for number, shot in enumerate(shots.read()):
            ending.check()
            try:
                shots.register(shot, scans)
            except ValueError as error:
                shots.refuse(shot.time, error)
                continue
            registered.add(number)
            said.append(f'{shots.clouds} at {seconds(shot.time)} s: {scans.last()}')
        if not registered:
            raise ValueError(f'{bag}: no scan is registered, {shots.unmatched()}')
        said.append(f'{counted(len(registered), "scan")} registered, {shots.unmatched()}')
        if task.adjust:
            said.append(scans.adjust().words())
        # Read again, as all of them may not fit into memory.
        shown = (it for number, it in enumerate(shots.read()) if number in registered)
        frame = task.settings.frame
        write_registration(task.folder, frame, scans.field, scans.records, map(shots.cloud, shown))
        return Registered(tuple(said), len(shots.refused))


@dataclass(frozen=True, slots=True)
class _Shot:
    """An answer, its cloud, and the time at which the cloud was recorded, ns."""

    answer: Any
    cloud: Any
    time: int


class _Shots:
    """The answers of a bag with their clouds, as the node `detector` pairs them."""

    def __init__(
        self, task: RegistrationTask, source: Source, bag: Path, tell: Callable[[str], None]
    ) -> None:
        self.clouds = _cloud_topic(task, source)
        self.refused: dict[str, None] = {}  # an ordered set
        self._task = task
        self._source = source
        self._tell = tell
        self._answers = _answer_topic(bag)
        self._counts = [0, 0]
        self._nearest = 0

    def read(self) -> Iterator[_Shot]:
        """Yield all pairs, the same every time."""
        self._counts = [0, 0]
        tolerance = round(self._task.cloud_settings.cloud_tolerance * 1e9)
        matcher = Matcher(tolerance, (WAITING_MEMORY, ANSWERS), self._counts)
        for connection, time, data in self._source.messages((self._answers, self.clouds)):
            side = CLOUD if connection.topic == self.clouds else ANSWER
            size = len(data) if side == CLOUD else 1
            try:
                message = self._source.stores.deserialize(connection, data)
                if side == CLOUD:
                    organised_points(message)
            except ValueError as error:
                self.refuse(time, error)
                continue
            if side == ANSWER and not is_answered(message):
                continue
            item = message, time
            match = matcher.put(side, nanoseconds(message.header), item, size)
            if match is not None:
                cloud, answer = (item, match) if side == CLOUD else (match, item)
                yield _Shot(answer[0], *cloud)
        waiting = matcher.waiting()
        self._nearest = waiting.nearest
        for side in (CLOUD, ANSWER):
            self._counts[side] += waiting.counts[side]

    def register(self, shot: _Shot, scans: Scans) -> None:
        """Register a pair, as the nodes do; a ValueError says why it does not fit."""
        answer, settings = shot.answer, self._task.cloud_settings
        shape = answer.height, answer.width
        found = located(organised_points(shot.cloud), answer.targets, shape, settings)
        scans.register(
            labelled(answer.targets, found),
            self._task.settings.minimum_confidence,
            nanoseconds(answer.header),
            shot.cloud.header.frame_id,
        )

    def cloud(self, shot: _Shot) -> np.ndarray | None:
        """Return the cloud of a pair with all its fields, None if they are not accepted."""
        try:
            return scan_cloud(shot.cloud, shot.cloud.header.frame_id)
        except ValueError as error:
            self.refuse(shot.time, error)
            return None

    def refuse(self, time: int, error: ValueError) -> None:
        """Tell of a cloud that is refused, once."""
        text = f'{self.clouds} at {seconds(time)} s: {error}'
        if text not in self.refused:
            self.refused[text] = None
            self._tell(text)

    def unmatched(self) -> str:
        """Return how many messages had no partner, in words."""
        alone = (
            f'{counted(self._counts[ANSWER], "image")} without a cloud, '
            f'{counted(self._counts[CLOUD], "cloud")} without an image'
        )
        if not self._nearest:
            return alone
        tolerance = self._task.cloud_settings.cloud_tolerance
        return (
            f'{alone}; their stamps are {self._nearest / 1e9:.9f} s apart or more, accepted is '
            f'cloud_tolerance, {tolerance:g} s'
        )


def _answer_topic(bag: Path) -> str:
    """Return the topic of the answers to the only image topic of a bag."""
    origin = json.loads(begun_with(bag))
    (image,) = origin['topics']
    return answer_topic(image, origin['output_topic'])


def _cloud_topic(task: RegistrationTask, source: Source) -> str:
    """Return the topic of the clouds, which has to be the only one unless it is chosen."""
    kinds = {item.topic: item.msgtype for item in source.connections}
    found = [topic for topic, kind in kinds.items() if kind == POINT_CLOUD]
    if not found:
        raise ValueError(f'{source.path} has no clouds, accepted is a topic of {POINT_CLOUD}')
    chosen = task.cloud_topic
    if not chosen and len(found) > 1:
        raise ValueError(
            f'{source.path} has clouds on {", ".join(found)}, accepted is a cloud_topic'
        )
    if chosen and chosen not in found:
        what = f'is of {kinds[chosen]}' if chosen in kinds else 'does not exist'
        raise ValueError(
            f'{source.path}: cloud_topic {chosen} {what}, accepted is one of {", ".join(found)}'
        )
    return chosen or found[0]
