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
from functools import partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.task import Future

from ahf_ros.nodes.comparison import Comparison
from ahf_ros.nodes.process import run
from ahf_ros.nodes.settings import IlluminationNodeSettings
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings

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

RATE = 1.0
"""Images per second."""

WAITING_RATE = 0.001
"""Images per second until all nodes are connected: the first image would be 1000 s away."""

PATIENCE = 180.0
"""Longest time without an answer, s."""

SHUTDOWN = 20.0
"""Time that a node is given to end, s."""


class Processes:
    """Nodes of this package in processes of their own, which end with the context."""

    def __init__(self) -> None:
        self._started: list[subprocess.Popen] = []

    def __enter__(self) -> Processes:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all nodes, in an orderly way if they can."""
        for process in self._started:
            process.send_signal(signal.SIGINT)
        for process in self._started:
            try:
                process.wait(SHUTDOWN)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def start(self, node: str, space: str, **parameters: object) -> None:
        """Start a node in a namespace."""
        given = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
        names = ('-r', f'__ns:={space}', '-r', f'image:={NAMESPACE}/image')
        ros = ('--ros-args', '--log-level', 'warn', *names, *given)
        # rclpy warns of responses that get lost; their requests are repeated.
        unwarned = '-W', 'ignore:failed to send response'
        command = (sys.executable, *unwarned, '-m', 'ahf_ros.nodes', node, *ros)
        self._started.append(subprocess.Popen(command))

    def any_ended(self) -> bool:
        """Return whether a node has ended."""
        return any(process.poll() is not None for process in self._started)


class Demo(Comparison):
    """A comparison that ends when another node has ended, or does nothing.

    Parameters
    ----------
    processes : Processes
        The detectors and the camera, which waits to be told that all are connected.
    options : argparse.Namespace
        The options of the command line.
    """

    def __init__(self, processes: Processes, options: argparse.Namespace) -> None:
        titles = {space: title for space, (title, _) in DETECTORS.items()}
        origin = f'{options.light}, ambient light {options.ambient:g}'
        super().__init__(titles, options.images, options.output, origin)
        self._processes = processes
        self._camera = self.create_client(SetParameters, 'illumination/set_parameters')
        nodes = 'illumination', *(f'{space}/detector' for space in titles)
        self._undiscovered = {
            node: self.create_client(GetParameters, f'{node}/get_parameters') for node in nodes
        }
        self._waiting = True
        self._seen = 0
        self._changed = time.monotonic()
        self.create_timer(0.2, self._watch)

    def _watch(self) -> None:
        ready = self._waiting and self._camera.service_is_ready() and self.connected()
        if ready and self._known():
            self._waiting = False
            rate = Parameter('rate', value=RATE).to_parameter_msg()
            self._camera.call_async(SetParameters.Request(parameters=[rate]))
        if self.answered != self._seen:
            self._seen, self._changed = self.answered, time.monotonic()
        reason = None
        if self._processes.any_ended():
            reason = 'a node has ended'
        elif time.monotonic() - self._changed > PATIENCE:
            reason = f'no image was answered for {PATIENCE:.0f} s'
        if reason and not self.ended.done():
            print(reason, file=sys.stderr)
            self.ended.set_result(1)

    def _known(self) -> bool:
        """Return whether all nodes know this one, and ask those that may not.

        What a node sends to a subscription that it does not know yet gets lost. Once it has
        answered a client, it knows the subscriptions that are older.
        """
        for node, client in tuple(self._undiscovered.items()):
            if client.service_is_ready():
                asked = client.call_async(GetParameters.Request())
                asked.add_done_callback(partial(self._meet, node))
        return not self._undiscovered

    def _meet(self, node: str, _: Future) -> None:
        self._undiscovered.pop(node, None)


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
    try:
        IlluminationNodeSettings(frames=options.images, scene=SceneSettings(**SCENE, **scene))
        Path(options.output).mkdir(parents=True, exist_ok=True)
    except (ValueError, OSError) as error:
        made.error(str(error))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault(profile_variable(), str(shared_memory_profile()))
    print(f'{SCENE["targets"]} targets under {options.light}, being rendered ...', flush=True)
    with Processes() as processes:
        for space, (_, parameters) in DETECTORS.items():
            # The camera waits until all are connected, so that no image for long is no fault.
            common = {'expected_targets': SCENE['targets'], 'image_timeout': 0.0}
            processes.start('detector', f'{NAMESPACE}/{space}', **common, **parameters)
        frames = {'frames': options.images, 'rate': WAITING_RATE}
        processes.start('illumination', NAMESPACE, **frames, **SCENE, **scene)
        return run(partial(Demo, processes, options), ['--ros-args', '-r', f'__ns:={NAMESPACE}'])


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
    made.add_argument('--images', type=int, default=1, help='number of different images')
    made.add_argument('--seed', type=int, default=scene.seed, help='seed of the first image')
    made.add_argument('--output', default='demo', help='folder for pictures')
    return made
