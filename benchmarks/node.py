"""What a node costs beside the identification: images of 10.6 MP from another process.

First an image at a time is sent and its answer waited for. The node says how long an answer took
it from the message in to the message out (`latency` on /diagnostics, in ms), the answer how long
the identification took (`filter.duration`): the difference is the node's own time, and what is
left of the time from sending to answer is that of the transport there and back. Then images are
sent as fast as they can be to a queue that is lossless, and at a steady rate to one that keeps the
latest.

    python -m benchmarks.node [--images 20] [--rate 10] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.demo import profile_variable
from ahf_ros.nodes.image_msg import image_message
from ahf_ros.nodes.settings import LATEST, LOSSLESS
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.filter import machine
from support import live

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_shm.xml'
TRANSPORTS = {'defaults': {}, PROFILE.name: {profile_variable(): str(PROFILE)}}
"""Environments by the names of what they set up."""

Figures = dict[str, float]


class Line:
    """A node, images to it, and when which answer came.

    Parameters
    ----------
    graph : live.Graph
    queue : str
        Of the node.
    images : int
        Most images that will be sent.
    """

    def __init__(self, graph: live.Graph, queue: str, images: int) -> None:
        self._graph = graph
        self._diagnostics: dict[str, str] = {}
        self.sent: dict[int, float] = {}
        self.answered: dict[int, tuple[float, float]] = {}
        namespace = f'/{queue}'
        self._node = graph.start(
            'detector',
            *('-r', f'__ns:={namespace}', '-r', f'/diagnostics:={namespace}/diagnostics'),
            *('-p', f'queue:={queue}'),
        )
        for kind, topic, callback in (
            (CodedTargetArray, 'coded_targets', self._on_answer),
            (DiagnosticArray, 'diagnostics', self._on_diagnostics),
        ):
            graph.node.create_subscription(kind, f'{namespace}/{topic}', callback, images)
        self._publisher = graph.node.create_publisher(Image, f'{namespace}/image', images)
        graph.until(lambda: self._publisher.get_subscription_count() and self._diagnostics)

    def _on_answer(self, answer: CodedTargetArray) -> None:
        self.answered[answer.header.stamp.sec] = time.monotonic(), answer.filter.duration

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._diagnostics = {item.key: item.value for item in message.status[0].values}

    def told(self, key: str) -> float:
        """Return what the node said last about something."""
        return float(self._diagnostics[key])

    def send(self, message: Image) -> int:
        """Send an image and return its number."""
        message.header.stamp.sec = number = len(self.sent) + 1
        self.sent[number] = time.monotonic()
        self._publisher.publish(message)
        return number

    def until(self, condition: Callable[[], Any]) -> None:
        """Wait for a condition."""
        self._graph.until(condition)

    def times(self, number: int) -> tuple[float, float]:
        """Return the time from an image to its answer, and that of its identification, s."""
        answered, duration = self.answered[number]
        return answered - self.sent[number], duration

    def close(self) -> None:
        """End the node."""
        self._node.end()


def one_at_a_time(graph: live.Graph, message: Image, images: int) -> Figures:
    """Return medians and the longest time of the node, in ms; the first image is left out."""
    line = Line(graph, LATEST, images + 1)
    rows = []
    for _ in range(images + 1):
        number = line.send(message)
        line.until(lambda number=number: line.told('answered') == number in line.answered)
        total, identification = line.times(number)
        latency = line.told('latency (s)')
        rows.append((total, identification, latency - identification, total - latency))
    line.close()
    names = 'answer', 'identification', 'node', 'transport'
    columns = dict(zip(names, zip(*rows[1:], strict=True), strict=True))
    figures = {f'{name} (ms)': 1e3 * median(values) for name, values in columns.items()}
    return figures | {'node, maximum (ms)': 1e3 * max(columns['node'])}


def all_at_once(graph: live.Graph, message: Image, images: int) -> Figures:
    """Return how many images a lossless queue answers, and how fast."""
    line = Line(graph, LOSSLESS, images)
    for _ in range(images):
        line.send(message)
    line.until(lambda: images in line.answered)
    seconds = max(answered for answered, _ in line.answered.values()) - line.sent[1]
    line.close()
    return {
        'images': images,
        'lost': images - len(line.answered),
        'rate (Hz)': len(line.answered) / seconds,
    }


def at_a_rate(graph: live.Graph, message: Image, images: int, rate: float) -> Figures:
    """Return how old images are when a queue that keeps the latest comes to identify them."""
    line = Line(graph, LATEST, images)
    started = time.monotonic()
    for number in range(images):
        line.until(lambda number=number: time.monotonic() >= started + number / rate)
        line.send(message)
    line.until(lambda: images in line.answered)
    times = [line.times(number) for number in line.answered]
    line.close()
    return {
        'images': images,
        'answered': len(times),
        'replaced while waiting': images - len(times),
        'maximum wait (ms)': 1e3 * max(total - own for total, own in times),
        'maximum identification (ms)': 1e3 * max(own for _, own in times),
    }


def measured(options: argparse.Namespace) -> dict[str, Figures]:
    """Return the figures of the transport that the environment says."""
    scene = SceneSettings(width=options.width, height=options.height, targets=options.targets)
    message = image_message(render(scene).image, Header())
    with live.opened() as graph:
        return {
            'one at a time': one_at_a_time(graph, message, options.images),
            LOSSLESS: all_at_once(graph, message, options.images),
            LATEST: at_a_rate(graph, message, options.images, options.rate),
        }


def markdown(report: dict[str, Any]) -> str:
    """Return a table of each kind of figures, a row a transport."""
    lines = []
    for kind in next(iter(report['transports'].values())):
        rows = {name: figures[kind] for name, figures in report['transports'].items()}
        names = list(next(iter(rows.values())))
        lines += ['', f'| {kind} | {" | ".join(names)} |', '|---' * (len(names) + 1) + '|']
        lines += [
            f'| {name} | {" | ".join(f"{row[of]:.4g}" for of in names)} |'
            for name, row in rows.items()
        ]
    return '\n'.join(lines[1:])


def main() -> int:
    """Measure with every transport, each in a process of its own, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--images', type=int, default=20, help='of each kind')
    parser.add_argument('--rate', type=float, default=10.0, help='of images to the latest, Hz')
    parser.add_argument('--width', type=int, default=3984, help='px')
    parser.add_argument('--height', type=int, default=2656, help='px')
    parser.add_argument('--targets', type=int, default=54)
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    parser.add_argument('--alone', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.alone:
        print(json.dumps(measured(options)))
        return 0
    report: dict[str, Any] = {'machine': machine(), 'transports': {}}
    for name, environment in TRANSPORTS.items():
        done = subprocess.run(
            [sys.executable, '-m', 'benchmarks.node', *sys.argv[1:], '--alone'],
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            check=True,
        )
        report['transports'][name] = json.loads(done.stdout)
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    print(markdown(report))
    return 0


if __name__ == '__main__':
    sys.exit(main())
