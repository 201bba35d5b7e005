"""How long a stream of images waits for its answers, and how fast it may be without a loss.

Images under stripes that stay as they are, each with noise of its own, come from another process,
at two sizes, with the defaults of Fast DDS and with `config/fastdds_shm.xml`. One node searches
every image, another one follows targets; both look for all families, or for the one that is there.
Except for the last figure, a node keeps the latest image.

- First: the time to the answer to the first image.
- Latency: from the stamp of an image, given when it is sent, to its answer, with one image sent at
  a time; beside it the time of the identification itself, the median and the shortest.
- Rate: the highest of a series of falling rates at which every image of a stream is identified.
- Lossless: how many images a second a lossless queue answers, all of them sent at once.

With `--before`, every figure is also that of another checkout of this repository. Latencies are
measured in turn, image by image, so that their ratio holds on a machine with other work, too.

    python -m benchmarks.latency [--images 40] [--before FOLDER] [--output docs/figures/latency]
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median, quantiles

import numpy as np
import rclpy
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.settings import LATEST, LOSSLESS
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from support import live

PROFILE = Path(__file__).resolve().parents[1] / 'config' / 'fastdds_shm.xml'
VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
TRANSPORTS = {'defaults': {}, PROFILE.name: dict.fromkeys(VARIABLES, str(PROFILE))}
"""Environments by the names of what they set up."""

SIZES = {'2.5 MP': (1936, 1296, 10.0), '10.6 MP': (3984, 2656, 20.0)}
"""Width and height of the images, and the radius of the dots of 54 targets, px."""

NOISE, IMAGES = 1.5, 8
"""Deviation of the noise of an image, and the number of images with noise of their own."""

_NAMED = '-p', 'family:=metashape12'
NODES = {
    'searched': ('-p', 'follow:=0'),
    'followed': (),
    'searched, named': ('-p', 'follow:=0', *_NAMED),
    'followed, named': _NAMED,
}
"""Arguments of the nodes, by the names of their rows; in two of them the family is named."""

STEP = 0.93
"""Ratio of two rates of the series."""

SLOWEST = 0.2
"""Last rate of the series, as a fraction of the first one."""

PAUSE = 0.5
"""Time without an answer after which the rest of a stream is lost, in times of an answer."""

Figures = dict[str, float]


class Stream:
    """A node, images to it, and when each was sent and answered.

    Parameters
    ----------
    graph : live.Graph
    messages : list of Image
        Sent in turn, again and again.
    namespace : str
        Of the node.
    folder : Path or None
        Checkout whose node it is.
    given : sequence of str
        Its arguments.
    """

    def __init__(
        self,
        graph: live.Graph,
        messages: list[Image],
        namespace: str,
        folder: Path | None,
        given: Sequence[str],
    ) -> None:
        self._graph = graph
        self._messages = messages
        places = '-r', f'__ns:={namespace}', '-r', f'/diagnostics:={namespace}/diagnostics'
        graph.start('detector', *places, *given, folder=folder)
        self._publisher = graph.node.create_publisher(Image, f'{namespace}/image', 100)
        self.sent: dict[int, float] = {}
        self.answered: dict[int, tuple[float, float]] = {}
        self.given_up: set[int] = set()
        graph.node.create_subscription(
            CodedTargetArray, f'{namespace}/coded_targets', self._on_answer, 1000
        )
        graph.until(self._publisher.get_subscription_count)

    def _on_answer(self, answer: CodedTargetArray) -> None:
        number = answer.header.stamp.sec
        if answer.status == CodedTargetArray.OK:
            self.answered[number] = time.monotonic() - self.sent[number], answer.filter.duration
        else:
            self.given_up.add(number)

    def send(self) -> int:
        """Send the image and return its number."""
        number = len(self.sent) + 1
        message = self._messages[number % len(self._messages)]
        message.header.stamp.sec = number
        self.sent[number] = time.monotonic()
        self._publisher.publish(message)
        return number

    def wait(self, until: Callable[[], bool], limit: float) -> bool:
        """Return whether a condition comes true before a time of the monotonic clock."""
        while not until():
            left = limit - time.monotonic()
            if left <= 0:
                return False
            rclpy.spin_once(self._graph.node, timeout_sec=left)
        return True

    def answer(self) -> tuple[float, float]:
        """Send an image; return the time to its answer and that of its identification, s."""
        number = self.send()
        limit = time.monotonic() + live.PATIENCE
        assert self.wait(lambda: number in self.answered, limit), 'no answer'
        return self.answered[number]

    def all_identified(self, images: int, rate: float, patience: float) -> bool:
        """Return whether every image of a stream is identified, none given up for a newer one."""
        started, first = time.monotonic(), len(self.sent) + 1
        for number in range(images):
            self.wait(lambda: False, started + number / rate)
            self.send()
        wanted = set(range(first, first + images))

        def known() -> int:
            return len(wanted & (self.answered.keys() | self.given_up))

        while (count := known()) < images:
            until = time.monotonic() + patience
            if not self.wait(lambda: known() > count, until):
                return False
        return not wanted & self.given_up


def noisy(image: np.ndarray) -> Iterator[np.ndarray]:
    """Yield images that differ from one in their noise."""
    generator = np.random.default_rng(1)
    for _ in range(IMAGES):
        noise = generator.normal(0.0, NOISE, image.shape)
        yield np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def all_at_once(stream: Stream, images: int) -> float:
    """Return how many images a second a lossless queue answers, Hz."""
    stream.answer()
    started = time.monotonic()
    for _ in range(images):
        stream.send()
    limit = started + images * live.PATIENCE
    assert stream.wait(lambda: len(stream.answered) == len(stream.sent), limit), 'images are lost'
    return images / (time.monotonic() - started)


def latencies(streams: dict[str, Stream], images: int) -> dict[str, Figures]:
    """Return the latency of each node, an image of one after an image of the other."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in streams}
    for _ in range(images + 2):
        for name, stream in streams.items():
            times[name].append(stream.answer())
    figures = {}
    for name, rows in times.items():
        totals, own = zip(*rows[2:], strict=True)
        figures[name] = {
            'first (ms)': 1e3 * rows[0][0],
            'p50 (ms)': 1e3 * median(totals),
            'p99 (ms)': 1e3 * quantiles(totals, n=100, method='inclusive')[98],
            'identification (ms)': 1e3 * median(own),
            'shortest (ms)': 1e3 * min(own),
        }
    return figures


def rate_without_loss(stream: Stream, images: int, latency: Figures) -> float:
    """Return the highest rate of a series at which all images are identified, Hz; 0: at none."""
    rate = first = 1.1e3 / latency['shortest (ms)']
    patience = max(1.0, (1 + PAUSE) * 2e-3 * latency['p99 (ms)'])
    while rate > SLOWEST * first:
        if stream.all_identified(images, rate, patience):
            return rate
        rate *= STEP
    return 0.0


def measured(options: argparse.Namespace) -> dict[str, Figures]:
    """Return the figures with the transport that the environment says, by size and checkout."""
    rows: dict[str, Figures] = {}
    nodes = {name: (None, given) for name, given in NODES.items()}
    if options.before:
        nodes = {'before': (options.before, ()), **nodes}
    for size in options.sizes:
        width, height, radius = SIZES[size]
        scene = SceneSettings(
            width=width, height=height, dot_radius=radius, light=options.light, ambient=0.3
        )
        messages = [image_message(it, Header()) for it in noisy(render(scene).image)]
        with live.opened() as graph:
            latest, lossless = (
                {
                    name: Stream(
                        graph,
                        messages,
                        f'/{queue}_{number}',
                        folder,
                        ('-p', f'queue:={queue}', *given),
                    )
                    for number, (name, (folder, given)) in enumerate(nodes.items())
                }
                for queue in (LATEST, LOSSLESS)
            )
            figures = latencies(latest, options.images)
            for name, row in figures.items():
                rate = rate_without_loss(latest[name], options.images, row)
                row['rate without loss (Hz)'] = rate
                row['lossless (Hz)'] = all_at_once(lossless[name], options.images)
                rows[f'{size}, {name}'] = row
    return rows


def markdown(figures: report.Report) -> str:
    """Return the figures as a table, a row a transport, size and checkout."""
    rows = {
        f'{name}, {row}': of
        for name, it in figures['transports'].items()
        for row, of in it.items()
    }
    names = list(next(iter(rows.values())))
    cells = [(name, *(f'{of[it]:.4g}' for it in names)) for name, of in rows.items()]
    return '\n'.join(report.table((figures['light'], *names), cells))


def main() -> int:
    """Measure with every transport, each in a process of its own, and print."""
    made = report.parser(__doc__, seeds=False)
    made.add_argument('--images', type=int, default=40, help='of each stream')
    made.add_argument('--light', default='stripe', help='on the targets')
    made.add_argument('--sizes', nargs='+', choices=SIZES, default=list(SIZES))
    made.add_argument('--transports', nargs='+', choices=TRANSPORTS, default=list(TRANSPORTS))
    made.add_argument(
        '--before', type=Path, metavar='FOLDER', help='another checkout, measured in turn'
    )
    made.add_argument('--alone', action='store_true', help=argparse.SUPPRESS)
    options = made.parse_args()
    if options.alone:
        print(json.dumps(measured(options)))
        return 0
    transports = {}
    for name in options.transports:
        done = subprocess.run(
            [sys.executable, '-m', 'benchmarks.latency', *sys.argv[1:], '--alone'],
            env={**os.environ, **TRANSPORTS[name]},
            stdout=subprocess.PIPE,
            check=True,
        )
        transports[name] = json.loads(done.stdout)
    figures = {'machine': report.machine(), 'light': options.light, 'transports': transports}
    report.publish(figures, markdown(figures), options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
