"""Days of a node in minutes: whether it answers every image, and keeps its size.

A node `detector` with a lossless queue gets small images over DDS, in several encodings, and
messages among them that are no images. Meanwhile parameters change, also those that make it
subscribe anew, services are called, and other participants come, look at its images for a while
and go. Every image has to be answered with the IDs that it shows, every message that is none has
to be counted as rejected; memory, threads and open files of the process are looked at all along,
each time with no image in work, so that they compare. The limit is for the peak in between.

    python -m benchmarks.soak [--frames 20000] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rich.console import Console
from rich.progress import track
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.image_msg import image_message
from ahf_ros.srv import Identify
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.filter import machine
from support import live

SCENE = SceneSettings(width=320, height=240, targets=3, dot_radius=9.0)
NAME = '/soak/detector'

WAITING = 20
"""Most images that are sent and not yet answered."""

LOOKS = 400
"""How often memory, threads and files are looked at."""

WARM = 0.2
"""Share of the images after which memory has to keep its size."""

SPREAD = 0.02
"""Share of its size by which memory may differ from it then."""

LIMIT = 200.0
"""Maximum memory of the node, MB."""


@dataclass(frozen=True)
class Look:
    """The size of the process after some images.

    Attributes
    ----------
    images : int
        Answered so far.
    memory : float
        Resident, MB.
    peak : float
        Maximum of that up to now, as the kernel knows it, MB.
    threads, files : int
        At that time; files are all open descriptors.
    """

    images: int
    memory: float
    peak: float
    threads: int
    files: int


@dataclass(frozen=True)
class Frame:
    """An image and the IDs of the targets that it shows."""

    message: Image
    ids: tuple[int, ...]


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
            made.append(Frame(sent_as(encoding, pixels), ids))
    return made


def sent_as(encoding: str, pixels: np.ndarray) -> Image:
    """Return the message of pixels in an encoding; what is wider than the scene is padding."""
    rows = np.frombuffer(pixels.tobytes(), np.uint8).reshape(len(pixels), -1)
    message = image_message(rows, Header())
    message.encoding, message.width = encoding, SCENE.width
    return message


def garbage() -> list[Image]:
    """Return messages of type Image that are no images."""
    gray = render(SCENE).image

    def changed(**changes: Any) -> Image:
        message = image_message(gray, Header())
        for name, value in changes.items():
            setattr(message, name, value)
        return message

    floats = gray.astype('<f4')
    return [
        Image(),
        changed(step=SCENE.width - 1),
        changed(height=SCENE.height + 1),
        changed(height=0),
        changed(width=0),
        changed(width=2**16, height=2**16, step=2**16),
        changed(width=2**32 - 1, height=2**32 - 1, step=2**32 - 1),
        changed(encoding='8SC1'),
        changed(encoding='jpeg'),
        changed(encoding='mono8\n'),
        changed(encoding='64FC4'),
        changed(height=8),
        image_message(np.full(gray.shape, 7, np.uint8), Header()),
        sent_as('32FC1', floats * np.nan),
        sent_as('32FC1', floats + np.inf),
        sent_as('32FC1', -floats),
    ]


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
            self._node.create_subscription(kind, topic, self._counter(topic), 10)

    def _counter(self, topic: str) -> Callable[[Any], None]:
        return lambda _: self.seen.update([topic])

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

    Parameters
    ----------
    graph : live.Graph
    count : int
        Images that are sent; one message in ten that is none comes in addition.
    interval : int
        Images from one thing that happens beside them to the next.
    """

    def __init__(self, graph: live.Graph, count: int, interval: int = 25) -> None:
        self._graph = graph
        self._count, self._interval = count, interval
        self._valid = frames()
        self.sent = self.answered = self.wrong = self.garbage = self.visits = 0
        self.changes = self.requests = 0
        self.looks: list[Look] = []
        self._due: dict[int, tuple[int, ...]] = {}
        self._diagnostics: dict[str, str] = {}
        self._visitor: Visitor | None = None
        self.node = graph.start(
            'detector',
            *('-r', '__ns:=/soak', '-r', '/diagnostics:=/soak/diagnostics'),
            *('-p', 'queue:=lossless', '-p', 'queue_memory:=1', '-p', 'detector:=traditional'),
        )
        graph.node.create_subscription(
            CodedTargetArray, '/soak/coded_targets', self._on_answer, 1000
        )
        graph.node.create_subscription(
            DiagnosticArray, '/soak/diagnostics', self._on_diagnostics, 10
        )
        self._image = graph.node.create_publisher(Image, '/soak/image', 1000)
        graph.until(
            lambda: (
                self._image.get_subscription_count()
                and graph.node.count_publishers('/soak/coded_targets')
                and self._diagnostics
            )
        )

    def _on_answer(self, message: CodedTargetArray) -> None:
        number, ids = next(iter(self._due.items()), (0, ()))
        if message.header.stamp.sec != number:
            raise AssertionError(
                f'the answer is to image {message.header.stamp.sec}, it is the turn of {number}'
            )
        del self._due[number]
        self.answered += 1
        self.wrong += ids != tuple(target.id for target in message.targets)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._diagnostics = {item.key: item.value for item in message.status[0].values}

    def run(self) -> None:
        """Send everything, and wait until all of it is answered or rejected."""
        happenings = self._happenings()
        bad, valid = cycle(garbage()), cycle(self._valid)
        period = max(1, self._count // LOOKS)
        console = Console(stderr=True)
        for number in track(range(1, self._count + 1), 'images', console=console):
            self._send(next(valid))
            if number % 10 == 0:
                self._image.publish(next(bad))
                self.garbage += 1
            if number % self._interval == 0:
                next(happenings)()
            if self._visitor:
                self._visitor.spin()
            self._graph.until(lambda: len(self._due) < WAITING)
            if number % period == 0:
                self._quiet()
                self.looks.append(look(self.node.process.pid, self.answered))
        self._quiet()
        if self._visitor:
            self._leave()
        self._graph.until(lambda: self.rejected == self.garbage)
        self.looks.append(look(self.node.process.pid, self.answered))

    @property
    def rejected(self) -> int:
        """Messages that the node says it has rejected."""
        return int(self._diagnostics['rejected'])

    def _send(self, frame: Frame) -> None:
        self.sent += 1
        frame.message.header.stamp.sec = self.sent
        self._due[self.sent] = frame.ids
        self._image.publish(frame.message)

    def _quiet(self) -> None:
        self._graph.until(lambda: not self._due)

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
        if response.result.successful != accepted:
            raise AssertionError(f'{given} is accepted: {response.result.successful}')
        self.changes += 1

    def _subscribe_anew(self) -> None:
        """Let the node subscribe to compressed images and back."""
        self._quiet()
        self._graph.until(lambda: self.rejected == self.garbage)
        self._set(True, image_transport='compressed')
        compressed = self._graph.publisher(CompressedImage, '/soak/image/compressed')
        compressed.publish(CompressedImage(format='jpeg', data=b'no image'))
        self.garbage += 1
        self._graph.until(lambda: self.rejected == self.garbage)
        self._set(True, image_transport='raw')
        self._graph.until(self._image.get_subscription_count)
        self._graph.until(lambda: not compressed.get_subscription_count())
        self._graph.node.destroy_publisher(compressed)

    def _visit(self) -> None:
        self._visitor = Visitor()
        self.visits += 1

    def _leave(self) -> None:
        if (visitor := self._visitor) is None:
            return
        limit = time.monotonic() + live.PATIENCE
        while len(visitor.seen) != 3:  # the node may not know of it yet
            if time.monotonic() > limit:
                raise AssertionError(f'a visitor saw only {dict(visitor.seen)}')
            self._send(self._valid[0])
            self._quiet()
            visitor.spin()
        visitor.leave()
        self._visitor = None

    def _identify(self) -> None:
        request = Identify.Request(image=self._valid[0].message)
        response = self._graph.call(Identify, f'{NAME}/identify', request)
        if not response.success:
            raise AssertionError(response.message)
        self.requests += 1

    def _reset(self) -> None:
        self._graph.call(Trigger, f'{NAME}/reset', Trigger.Request())
        self.requests += 1


def report(soak: Soak, seconds: float) -> dict[str, Any]:
    """Return what came out of a run."""
    warm = [it for it in soak.looks if it.images >= WARM * soak.sent]
    middle = float(np.median([it.memory for it in warm]))
    quarter = len(warm) // 4 or 1
    first, final = (
        float(np.median([it.memory for it in of])) for of in (warm[:quarter], warm[-quarter:])
    )
    last = soak.looks[-1]
    return {
        'images': soak.sent,
        'answered': soak.answered,
        'unexpected IDs': soak.wrong,
        'messages that are not images': soak.garbage,
        'rejected': soak.rejected,
        'parameters set': soak.changes,
        'services called': soak.requests,
        'participants that joined and left': soak.visits,
        'seconds': round(seconds, 1),
        'memory at the start (MB)': round(soak.looks[0].memory, 1),
        'memory when warm (MB)': round(middle, 1),
        'minimum, relative to that': round(min(it.memory for it in warm) / middle, 4),
        'maximum, relative to that': round(max(it.memory for it in warm) / middle, 4),
        'median of the first quarter when warm (MB)': round(first, 1),
        'median of the last quarter (MB)': round(final, 1),
        'peak (MB)': round(last.peak, 1),
        'limit (MB)': LIMIT,
        'threads when warm': min(it.threads for it in warm),
        'threads at the end': last.threads,
        'open files when warm': min(it.files for it in warm),
        'open files at the end': last.files,
    }


def kept(figures: dict[str, Any]) -> bool:
    """Return whether every image was answered rightly, in memory of constant size."""
    spread = max(
        figures['maximum, relative to that'] - 1, 1 - figures['minimum, relative to that']
    )
    answered = figures['answered'] == figures['images'] and not figures['unexpected IDs']
    return answered and spread <= SPREAD and figures['peak (MB)'] <= LIMIT


def markdown(figures: dict[str, Any], looks: list[Look]) -> str:
    """Return the figures and some of the looks as tables."""
    lines = ['| | |', '|---|---|']
    lines += [f'| {name} | {value} |' for name, value in figures.items()]
    lines += ['', '| images | memory MB | threads | open files |', '|---|---|---|---|']
    lines += [
        f'| {it.images} | {it.memory:.1f} | {it.threads} | {it.files} |'
        for it in looks[:: max(1, len(looks) // 10)]
    ]
    return '\n'.join(lines)


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--frames', type=int, default=20000, help='images that are sent')
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    options = parser.parse_args()
    with live.opened() as graph:
        soak = Soak(graph, options.frames)
        started = time.monotonic()
        soak.run()
        figures = report(soak, time.monotonic() - started)
    print(markdown(figures, soak.looks))
    if options.json:
        written = {**figures, 'machine': machine(), 'looks': [asdict(it) for it in soak.looks]}
        options.json.write_text(json.dumps(written, indent=1))
    return int(not kept(figures))


if __name__ == '__main__':
    sys.exit(main())
