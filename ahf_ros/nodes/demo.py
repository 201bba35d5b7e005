"""The main job in one command: three nodes, projected light, one line an image."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from ahf_ros.detectors import DETECTOR, DETECTOR_NAMES
from ahf_ros.nodes.process import run
from ahf_ros.nodes.scoreboard import Scoreboard
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings

PATIENCE = 180.0
"""Longest time without an image identified, s."""

SHUTDOWN = 20.0
"""Time that a node gets to end, s."""

PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
"""Where Fast DDS looks for its settings: up to Jazzy, and from Kilted on."""


class Demo(Scoreboard):
    """A scoreboard that ends when a node that it depends on has ended, or does nothing.

    Parameters
    ----------
    processes : sequence of subprocess.Popen
        The other nodes.
    """

    def __init__(self, processes: Sequence[subprocess.Popen]) -> None:
        super().__init__()
        self._processes = processes
        self._seen = 0
        self._changed = time.monotonic()
        self.create_timer(1.0, self._watch)

    def _watch(self) -> None:
        if self.count != self._seen:
            self._seen, self._changed = self.count, time.monotonic()
        reason = ''
        if any(process.poll() is not None for process in self._processes):
            reason = 'a node has ended'
        elif time.monotonic() - self._changed > PATIENCE:
            reason = f'no image was identified for {PATIENCE:.0f} s'
        if reason and not self.ended.done():
            print(reason, file=sys.stderr)
            self.ended.set_result(1)


def start(node: str, **parameters: object) -> subprocess.Popen:
    """Start a node of this package in a process of its own."""
    given = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    module = f'ahf_ros.nodes.{node}'
    return subprocess.Popen([sys.executable, '-m', module, '--ros-args', *given])


def end(process: subprocess.Popen) -> None:
    """End a node, orderly if it can."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(SHUTDOWN)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def shared_memory_profile() -> Path:
    """Return the settings of Fast DDS with room for whole images in shared memory."""
    try:
        share = Path(get_package_share_directory('ahf_ros'))
    except (PackageNotFoundError, OSError):  # installed with pip, where there is no index
        share = Path(sys.prefix, 'share', 'ahf_ros')
    return share / 'config' / 'fastdds_shm.xml'


def main(arguments: list[str] | None = None) -> int:
    """Show identification under projected light, by nodes in processes of their own."""
    options = parser().parse_args(arguments)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    for variable in PROFILE_VARIABLES:
        os.environ.setdefault(variable, str(shared_memory_profile()))
    print(f'{options.images} images under {options.light}, being rendered ...', flush=True)
    with ExitStack() as stack:
        processes = [
            start(
                'illumination',
                light=options.light,
                ambient=options.ambient,
                frames=options.images,
                rate=0.5,
            ),
            start(
                'detector',
                detector=options.detector,
                expected_targets=SceneSettings().targets,
                max_duration=20.0,
            ),
        ]
        for process in processes:
            stack.callback(end, process)
        status = run(
            partial(Demo, processes),
            ['--ros-args', '-p', f'images:={options.images}', '-p', f'pictures:={options.output}'],
        )
    if status == 0:
        print(f'pictures: {options.output}/')
    return status


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen on the command line."""
    made = argparse.ArgumentParser(prog='ahf_demo', description=main.__doc__)
    made.add_argument('--images', type=int, default=3, help='number of images (default: 3)')
    made.add_argument('--light', choices=LIGHT_NAMES, default='stripe', help='default: stripe')
    made.add_argument(
        '--ambient',
        type=float,
        default=SceneSettings().ambient,
        help='ambient light as a share of the projected one (default: %(default)s)',
    )
    made.add_argument(
        '--detector', choices=DETECTOR_NAMES, default=DETECTOR.default, help='default: %(default)s'
    )
    made.add_argument('--output', default='demo', help='folder for pictures (default: demo)')
    return made


if __name__ == '__main__':
    sys.exit(main())
