"""The method in one command: the same image under projected light, identified in three ways."""

from __future__ import annotations

import argparse
import inspect
import os
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from sensor_msgs.msg import Image

from ahf_ros.drawing.overlay import (
    DECODED_COLOUR,
    MISSED_COLOUR,
    TEXT_COLOUR,
    WRONG_COLOUR,
    overlay,
)
from ahf_ros.drawing.tiles import Tile, side_by_side
from ahf_ros.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.interchange.image_files import write_image
from ahf_ros.interchange.image_messages import decode_image
from ahf_ros.interchange.target_messages import identification_from
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.process import ProcessNode, run
from ahf_ros.nodes.scoreboard import line, method
from ahf_ros.nodes.settings import IlluminationNodeSettings
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings
from ahf_ros.target import Identification, Target, TrueTarget

DETECTORS: dict[str, tuple[str, dict[str, Any]]] = {
    'traditional': ('traditional', {'detector': 'traditional', 'ahf': False}),
    'adaptive': ('traditional with AHF', {'detector': 'traditional', 'ahf': True}),
    'ring': ('ring', {'detector': 'ring', 'ahf': False}),
}
"""Title and parameters of each detector, by its namespace."""

SCENE: dict[str, Any] = {'width': 1600, 'height': 1066, 'targets': 12}
"""What is rendered: few enough targets to see each of them in a picture of the whole."""

NAMESPACE = '/demo'
"""Namespace of all nodes, so that they use no topic of other programs."""

WIDTH = 800
"""Width of one of the images side by side, px."""

PATIENCE = 180.0
"""Longest time without an answer, s."""

SHUTDOWN = 20.0
"""Time that a node is given to end, s."""


class Demo(ProcessNode):
    """Waits until every detector has identified the scene, then says and shows what they saw.

    The scene is published over and over again, and the first answer of each detector counts. So
    nothing depends on which images a detector has no time for.

    Parameters
    ----------
    processes : list of subprocess.Popen
        The detectors.
    camera : callable
        Starts the camera; called when all detectors are connected.
    origin : str
        Title of the image as received.
    picture : Path
        Where to write the picture.
    """

    def __init__(
        self,
        processes: list[subprocess.Popen],
        camera: Callable[[], None],
        origin: str,
        picture: Path,
    ) -> None:
        super().__init__('demo')
        self._processes = processes
        self._camera: Callable[[], None] | None = camera
        self._origin = origin
        self._picture = picture
        self._truth: tuple[Target, ...] | None = None
        self._images: dict[str, np.ndarray] = {}
        self._answers: dict[str, Identification] = {}
        self._changed = time.monotonic()
        self.subscribe(CodedTargetArray, 'ground_truth', self._keep_truth)
        self.subscribe(Image, 'image', partial(self._keep_image, ''))
        outputs = []
        for space in DETECTORS:
            # With the latest answer only, the first one may not be seen.
            outputs += [
                self.subscribe(
                    CodedTargetArray,
                    f'{space}/coded_targets',
                    partial(self._keep_answer, space),
                    lossless=True,
                ),
                self.subscribe(
                    Image, f'{space}/detector/filtered_image', partial(self._keep_image, space)
                ),
            ]
        self._outputs = outputs
        self.create_timer(0.2, self._look)

    def _keep_truth(self, message: CodedTargetArray) -> None:
        self._truth = identification_from(message).targets

    def _keep_image(self, space: str, message: Image) -> None:
        if space not in self._images:
            self._images[space] = decode_image(message)

    def _keep_answer(self, space: str, message: CodedTargetArray) -> None:
        if space not in self._answers:
            self._answers[space] = identification_from(message)
            self._changed = time.monotonic()

    def _look(self) -> None:
        """Start the camera, and end when all is there, or when nothing more will come."""
        if self._camera and all(it.publishers() for it in self._outputs):
            self._camera()
            self._camera = None
        reason = ''
        if len(self._images) > len(DETECTORS) == len(self._answers) and self._truth is not None:
            self._show(self._truth)
        elif any(process.poll() is not None for process in self._processes):
            reason = 'a node has ended'
        elif time.monotonic() - self._changed > PATIENCE:
            reason = f'no image was answered for {PATIENCE:.0f} s'
        else:
            return
        if reason:
            print(reason, file=sys.stderr)
        if not self.ended.done():
            self.ended.set_result(1 if reason else 0)

    def _show(self, truth: tuple[Target, ...]) -> None:
        """Print a line for each detector, and write a picture of two columns."""
        width = max(len(title) for title, _ in DETECTORS.values())
        tiles = [Tile(self._images[''], self._origin, [(f'{len(truth)} targets', TEXT_COLOUR)])]
        for space, (title, _) in DETECTORS.items():
            answer = self._answers[space]
            print(f'  {title:{width}}  {line(answer, truth)}', flush=True)
            tiles.append(tile(f'{title}: {method(answer)}', self._images[space], answer, truth))
        write_image(self._picture, side_by_side([tiles[:2], tiles[2:]], WIDTH))
        print(f'  {self._picture}', flush=True)


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


@contextmanager
def processes() -> Iterator[list[subprocess.Popen]]:
    """Give a list for processes, and end them with the context, in an orderly way if they can."""
    started: list[subprocess.Popen] = []
    try:
        yield started
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
        for process in started:
            try:
                process.wait(SHUTDOWN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def start(node: str, space: str, **parameters: object) -> subprocess.Popen:
    """Start a node of this package in a namespace."""
    given = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    names = ('-r', f'__ns:={space}', '-r', f'image:={NAMESPACE}/image')
    ros = ('--ros-args', '--log-level', 'warn', *names, *given)
    return subprocess.Popen((sys.executable, '-m', 'ahf_ros.nodes', node, *ros))


def shared_memory_profile() -> Path:
    """Return the settings of Fast DDS with room for whole images in shared memory."""
    return _share('ahf_ros') / 'config' / 'fastdds_shm.xml'


def profile_variable() -> str:
    """Return the environment variable that names the settings of Fast DDS.

    Kilted, which brings version 9 of rmw_fastrtps_cpp, warns of the name that Jazzy needs.
    """
    about = ElementTree.parse(_share('rmw_fastrtps_cpp') / 'package.xml')
    major = int(about.findtext('version', '0').split('.')[0])
    return f'FAST{"DDS" if major >= 9 else "RTPS"}_DEFAULT_PROFILES_FILE'


def _share(package: str) -> Path:
    try:
        return Path(get_package_share_directory(package))
    except (PackageNotFoundError, OSError):  # installed with pip, where there is no index
        return Path(sys.prefix, 'share', package)


def main(arguments: list[str] | None = None) -> int:
    """Identify the same image in three ways, by nodes in processes of their own.

    The three ways are the detector `traditional` alone, the same with a filter that AHF finds,
    and the detector `ring`, which needs no filter. One line for each says what was right and
    wrong, and one picture shows it.
    """
    made = parser()
    options = made.parse_args(arguments)
    scene = {name: getattr(options, name) for name in ('light', 'ambient', 'seed')}
    picture = Path(options.output, 'image_1.jpg')
    try:
        IlluminationNodeSettings(scene=SceneSettings(**SCENE, **scene))
        picture.parent.mkdir(parents=True, exist_ok=True)
    except (ValueError, OSError) as error:
        made.error(str(error))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault(profile_variable(), str(shared_memory_profile()))
    print(f'{SCENE["targets"]} targets under {options.light}, being rendered ...', flush=True)
    with processes() as started:
        for space, (_, parameters) in DETECTORS.items():
            # The camera waits until all are connected, so that no image for long is no fault.
            common = {'expected_targets': SCENE['targets'], 'image_timeout': 0.0}
            started.append(start('detector', f'{NAMESPACE}/{space}', **common, **parameters))

        def camera() -> None:
            started.append(start('illumination', NAMESPACE, frames=1, **SCENE, **scene))

        origin = f'{options.light}, ambient light {options.ambient:g}'
        return run(
            partial(Demo, started, camera, origin, picture),
            ['--ros-args', '-r', f'__ns:={NAMESPACE}'],
        )


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        prog='ahf_demo',
        description=inspect.getdoc(main),
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    scene = SceneSettings()
    made.add_argument('--light', choices=LIGHT_NAMES, default='stripe', help='projected light')
    made.add_argument(
        '--ambient',
        type=float,
        default=scene.ambient,
        help='ambient light as a share of the projected light',
    )
    made.add_argument('--seed', type=int, default=scene.seed, help='seed of the image')
    made.add_argument('--output', default='demo', help='folder for the picture')
    return made
