"""Days of a node in minutes: whether it answers every image, and keeps its size.

A node `detector` with a lossless queue gets small images over DDS, in several encodings, and
messages among them that are no images. Meanwhile parameters change, also those that make it
subscribe anew, services are called, and other participants come, look at its images for a while
and go. Every image has to be answered with the IDs that it shows, every message that is none has
to be counted as rejected; memory, threads and open files of the process are looked at all along,
each time with no image in work, so that they compare.

The environment variable AHF_SOAK says how many images are sent. From 5000 on, the node has to keep
its memory as well.
"""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.srv import Identify
from support import live
from support.detector import overrides, own, values

COUNT = int(os.environ.get('AHF_SOAK', '130'))
LONG = 5000
"""Images from which on memory is looked at."""

SCENE = SceneSettings(width=320, height=240, targets=3, dot_radius=9.0)
NAME = '/soak/detector'

WAITING = 20
"""Most images that are sent and not yet answered."""

WARM = 0.2
"""Share of the images after which memory has to keep its size."""

Frame = tuple[Image, tuple[int, ...]]
"""An image and the IDs of the targets that it shows."""


@dataclass(frozen=True)
class Look:
    """The size of the process after some images."""

    images: int  # answered so far
    memory: float  # resident, MB
    peak: float  # maximum of that up to now, as the kernel knows it, MB
    threads: int
    files: int  # all open descriptors


def look(process: int, images: int) -> Look:
    """Return the size of a process, as Linux reports it."""
    folder = Path('/proc') / str(process)
    told = dict(line.split(':', 1) for line in (folder / 'status').read_text().splitlines())
    memory, peak = (int(told[name].split()[0]) / 1024 for name in ('VmRSS', 'VmHWM'))
    return Look(images, memory, peak, int(told['Threads']), len(list((folder / 'fd').iterdir())))


def frames() -> list[Frame]:
    """Return images of several scenes and encodings."""
    made = []
    for seed in range(4):
        scene = render(replace(SCENE, seed=seed))
        ids = tuple(target.id for target in scene.targets)
        gray = scene.image
        floats = gray.astype('<f4')
        floats[3, 5] = np.nan
        for encoding, pixels in (
            ('mono8', np.pad(gray, ((0, 0), (0, 7)))),
            ('bgr8', np.dstack([gray] * 3)),
            *([('mono16', gray.astype('<u2') * 16), ('32FC1', floats)] if seed == 0 else []),
        ):
            made.append((sent_as(encoding, pixels), ids))
    return made


def sent_as(encoding: str, pixels: np.ndarray) -> Image:
    """Return the message of pixels in an encoding; what is wider than the scene is padding."""
    rows = np.frombuffer(pixels.tobytes(), np.uint8).reshape(len(pixels), -1)
    message = image_message(rows, Header())
    message.encoding, message.width = encoding, SCENE.width
    return message


def garbage() -> list[Image]:
    """Return messages of type Image that are no images, each for another reason."""
    gray = render(SCENE).image
    made = [Image(), sent_as('32FC1', gray * np.float32(np.nan))]
    for name, value in (('step', 1), ('height', 2**32 - 1), ('width', 0), ('encoding', 'jpeg')):
        made.append(image_message(gray, Header()))
        setattr(made[-1], name, value)
    return made


class Visitor:
    """Another participant, which looks at everything that the node publishes."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('visitor', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.seen: Counter[str] = Counter()
        for kind, topic in (
            (Image, f'{NAME}/debug_image'),
            (Image, f'{NAME}/filtered_image'),
            (CodedTargetArray, '/soak/coded_targets'),
        ):
            callback = lambda _, topic=topic: self.seen.update([topic])  # noqa: E731
            self._node.create_subscription(kind, topic, callback, 10)

    def spin(self) -> None:
        """Take what has come in."""
        self._executor.spin_once(timeout_sec=0)

    def leave(self) -> None:
        """Go for good."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


class Soak:
    """One run: the node, what it is sent, and what becomes of it.

    One message in ten that is no image comes in addition to the images; `interval` images lie
    between one thing that happens beside them and the next.
    """

    def __init__(self, graph: live.Graph, count: int, interval: int) -> None:
        self._graph = graph
        self._count, self._interval = count, interval
        self._valid = frames()
        self.counts: Counter[str] = Counter()
        self.looks: list[Look] = []
        self._due: dict[int, tuple[int, ...]] = {}
        self.diagnostics: dict[str, str] = {}
        self._visitor: Visitor | None = None
        self.node = graph.start(
            'detector',
            *own('/soak'),
            *overrides(queue='lossless', queue_memory=1, detector='traditional'),
        )
        for kind, topic, callback in (
            (CodedTargetArray, '/soak/coded_targets', self._on_answer),
            (DiagnosticArray, '/soak/diagnostics', self._on_diagnostics),
        ):
            graph.node.create_subscription(kind, topic, callback, 1000)
        self._image = graph.node.create_publisher(Image, '/soak/image', 1000)
        graph.until(
            lambda: (
                self._image.get_subscription_count()
                and graph.node.count_publishers('/soak/coded_targets')
                and self.diagnostics
            )
        )

    def _on_answer(self, message: CodedTargetArray) -> None:
        turn, ids = next(iter(self._due.items()), (0, ()))
        assert message.header.stamp.sec == turn
        del self._due[turn]
        self.counts['answered'] += 1
        self.counts['unexpected IDs'] += ids != tuple(target.id for target in message.targets)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics = values(message)

    def run(self) -> None:
        """Send everything, and wait until all of it is answered or rejected."""
        happenings = self._happenings()
        bad, valid = cycle(garbage()), cycle(self._valid)
        period = max(1, self._count // 400)
        for place in range(1, self._count + 1):
            self._send(next(valid))
            if place % 10 == 0:
                self._send_garbage(self._image, next(bad))
            if place % self._interval == 0:
                next(happenings)()
            if self._visitor:
                self._visitor.spin()
            self._graph.until(lambda: len(self._due) < WAITING)
            if place % period == 0:
                self._look()
        self._leave()
        self._settle()
        self._look()

    def _send(self, frame: Frame) -> None:
        message, ids = frame
        self.counts['images'] += 1
        message.header.stamp.sec = self.counts['images']
        self._due[self.counts['images']] = ids
        self._image.publish(message)

    def _send_garbage(self, publisher: Any, message: Any) -> None:
        publisher.publish(message)
        self.counts['messages that are not images'] += 1

    def _look(self) -> None:
        self._graph.until(lambda: not self._due)
        self.looks.append(look(self.node.process.pid, self.counts['answered']))

    def _settle(self) -> None:
        """Wait until everything is answered or rejected."""
        self._graph.until(lambda: not self._due)
        bad = self.counts['messages that are not images']
        self._graph.until(lambda: int(self.diagnostics['rejected']) == bad)

    def _happenings(self) -> Iterator[Callable[[], None]]:
        """Yield what happens beside the images, in turn and over again."""
        return cycle(
            [
                lambda: self._set(True, expected_targets=3),
                self._visit,
                lambda: self._set(False, detector='ring', polarity='bright'),
                lambda: self._set(True, polarity='dark', seed=7),
                lambda: self._set(False, population=1, seed=8),
                self._identify,
                # One more than there are: filters are tried.
                lambda: self._set(True, expected_targets=4, max_evaluations=2, population=2),
                lambda: self._set(True, expected_targets=3, threads=1),
                self._leave,
                lambda: self._set(True, expected_targets=0, polarity='auto', threads=0),
                self._reset,
                self._subscribe_anew,
                lambda: self._set(False, min_radius=70.0, max_radius=60.0),
            ]
        )

    def _set(self, accepted: bool, **given: Any) -> None:
        parameters = [Parameter(name, value=it).to_parameter_msg() for name, it in given.items()]
        response = self._graph.call(
            SetParametersAtomically,
            f'{NAME}/set_parameters_atomically',
            SetParametersAtomically.Request(parameters=parameters),
        )
        assert response.result.successful == accepted, given
        self.counts['parameters set'] += 1

    def _subscribe_anew(self) -> None:
        """Let the node subscribe to compressed images and back."""
        self._settle()
        self._set(True, image_transport='compressed')
        compressed = self._graph.publisher(CompressedImage, '/soak/image/compressed')
        self._send_garbage(compressed, CompressedImage(format='jpeg', data=b'no image'))
        self._settle()
        self._set(True, image_transport='raw')
        self._graph.until(self._image.get_subscription_count)
        self._graph.until(lambda: not compressed.get_subscription_count())
        self._graph.node.destroy_publisher(compressed)

    def _visit(self) -> None:
        self._visitor = Visitor()
        self.counts['participants that joined and left'] += 1

    def _leave(self) -> None:
        if (visitor := self._visitor) is None:
            return
        limit = time.monotonic() + live.PATIENCE
        while len(visitor.seen) != 3:  # the node may not know of it yet
            assert time.monotonic() < limit, f'a visitor saw only {dict(visitor.seen)}'
            self._send(self._valid[0])
            self._graph.until(lambda: not self._due)
            visitor.spin()
        visitor.leave()
        self._visitor = None

    def _identify(self) -> None:
        request = Identify.Request(image=self._valid[0][0])
        response = self._graph.call(Identify, f'{NAME}/identify', request)
        assert response.success, response.message
        self.counts['services called'] += 1

    def _reset(self) -> None:
        self._graph.call(Trigger, f'{NAME}/reset', Trigger.Request())
        self.counts['services called'] += 1


@pytest.mark.skipif('AHF_SOAK' not in os.environ, reason='AHF_SOAK is not set')
def test_every_image_is_answered_and_nothing_is_left_behind(graph: live.Graph) -> None:
    # In a short one, everything happens once.
    soak = Soak(graph, COUNT, interval=25 if COUNT >= LONG else 10)
    soak.run()
    counts, last = soak.counts, soak.looks[-1]
    warm = [it for it in soak.looks if it.images >= WARM * counts['images']]
    assert counts['answered'] == counts['images'] >= COUNT
    assert counts['unexpected IDs'] == 0
    assert (
        int(soak.diagnostics['rejected']) == counts['messages that are not images'] > COUNT // 10
    )
    assert counts['parameters set'] >= 10
    assert counts['participants that joined and left'] >= 1
    # Threads of pools start when they are first needed: 3 of the executor, 3 of the worker.
    assert last.threads <= soak.looks[0].threads + 6
    assert last.files == min(it.files for it in warm)
    print(*soak.looks[:: max(1, len(soak.looks) // 10)], last, sep='\n')
    if COUNT >= LONG:
        memory, quarter = [it.memory for it in warm], len(warm) // 4
        assert median(memory[-quarter:]) <= 1.05 * median(memory[:quarter])
        assert last.peak <= 200  # MB
    assert soak.node.end()[0] == 0
