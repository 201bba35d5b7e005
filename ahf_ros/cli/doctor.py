"""`ahf doctor`: what is installed, and what is missing for what, as a text for a bug report."""

import argparse
import importlib.util
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import metadata

from ahf_ros.base.extras import EXTRAS, REQUIRED, missing
from ahf_ros.base.release import release

_OPENCV = tuple(
    f'opencv-{kind}python{head}' for kind in ('', 'contrib-') for head in ('', '-headless')
)
_NODES = ('rclpy', 'sensor_msgs', 'std_msgs', 'std_srvs', 'diagnostic_msgs', 'visualization_msgs')
# In a process of its own: what was compiled for another Python may end it.
_MIDDLEWARE = (
    'from rclpy.utilities import get_rmw_implementation_identifier as used; '
    'from ahf_ros.msg import CodedTargetArray; CodedTargetArray(); print(used())'
)
_VARIABLES = (
    *('ROS_DISTRO', 'RMW_IMPLEMENTATION', 'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE'),
    *('ROS_LOCALHOST_ONLY', 'FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE'),
    *('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'OPENCV_FOR_THREADS_NUM'),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command: none."""


def run(options: argparse.Namespace) -> int:
    """Print what is installed; the status is 1 if the command line lacks something."""
    problems = list(_problems())
    for title, lines in (
        ('', _machine()),
        ('extras', _extras()),
        ('nodes', _ros()),
        ('environment', (f'{it}={os.environ[it]}' for it in _VARIABLES if it in os.environ)),
        ('problems', iter(problems)),
    ):
        said = list(lines)
        if said and title:
            print(f'{title}:')
        for line in said:
            print(f'  {line}' if title else line)
    return int(bool(problems))


def _machine() -> Iterator[str]:
    yield (
        f'ahf_ros {release()}, Python {platform.python_version()}, {platform.system()} '
        f'{platform.release()} {platform.machine()}, {os.cpu_count()} cores'
    )
    for name in REQUIRED:
        if not name.startswith('opencv'):
            yield f'{name} {_version(name) or "is missing"}'
    if importlib.util.find_spec('cv2'):
        yield from _opencv()
    else:
        yield 'OpenCV is missing'


def _opencv() -> Iterator[str]:
    import cv2

    about = cv2.getBuildInformation()
    found = {
        label: match[1].strip()
        for label in ('Parallel framework', 'Intel IPP', 'Baseline', 'Dispatched code generation')
        if (match := re.search(rf'{label}: *(.*)', about))
    }
    words = ', '.join(f'{label} {value}' for label, value in found.items() if value)
    wheels = ', '.join(f'{name} {_version(name)}' for name in _OPENCV if _version(name))
    source, threads = wheels or 'not of pip', cv2.getNumThreads()
    yield f'OpenCV {cv2.__version__} ({source}) with {threads} threads: {words}'


def _extras() -> Iterator[str]:
    for extra, (purpose, _) in EXTRAS.items():
        yield f'{extra}: {missing(extra) or f"complete, for {purpose}"}'


def _ros() -> Iterator[str]:
    missing = [name for name in _NODES if importlib.util.find_spec(name) is None]
    if missing:
        yield (
            f'{", ".join(missing)} missing: source a ROS 2 installation, or pip install . ./ros '
            'in the sources of ahf_ros'
        )
        return
    if importlib.util.find_spec('ahf_ros.msg') is None:
        yield 'the messages are not compiled: colcon build, or pip install . ./ros'
        return
    done = subprocess.run([sys.executable, '-c', _MIDDLEWARE], capture_output=True, text=True)
    used = done.stdout.strip()
    if done.returncode or not used:
        reason = (done.stderr.strip().splitlines() or [f'status {done.returncode}'])[-1]
        yield f'ROS 2 cannot be used: {reason}'
        return
    name = next((it for it in ('ros-rclpy', 'rclpy') if _version(it)), 'rclpy')
    yield f'rclpy {_version(name)}, {used}; messages compiled'
    if used.startswith('rmw_fastrtps') and sys.platform == 'linux':
        yield f'shared memory: {_shared_memory()}'


def _shared_memory() -> str:
    """Return how much shared memory there is, which large messages go through."""
    try:
        about = os.statvfs('/dev/shm')
    except OSError as error:
        return f'/dev/shm: {error.strerror}'
    return f'{about.f_bavail * about.f_frsize / 2**20:.0f} MB free in /dev/shm'


def _problems() -> Iterator[str]:
    for name in REQUIRED:
        if not _version(name) and not name.startswith('opencv'):
            yield f'{name} is missing: pip install {name}'
    several = [name for name in _OPENCV if _version(name)]
    if len(several) > 1:
        yield (
            f'{" and ".join(several)} are installed and overwrite each other: pip uninstall '
            f'{" ".join(several)}, then pip install opencv-python-headless'
        )
    if not importlib.util.find_spec('cv2'):
        yield 'OpenCV is missing: pip install --force-reinstall --no-deps opencv-python-headless'
    with suppress(ModuleNotFoundError):
        from ahf_ros import kernels

        try:
            kernels.exponentials([0.0])
        except ImportError as error:
            yield str(error)
    sourced = os.environ.get('ROS_DISTRO')
    wheels = _version('ahf-ros-interfaces')
    if sourced and wheels and os.environ.get('AMENT_PREFIX_PATH'):
        yield (
            f'ROS 2 {sourced} is sourced, and the messages in this environment are compiled for '
            'ROS 2 from PyPI: start nodes where no ROS is sourced, or leave this environment'
        )


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ''
