"""Say at once what a machine lacks to install ahf_ros, or its nodes, with pip.

make runs it, and so does pip install ./ros. Any Python from 3.6 will do, also one that is too old
for the package.
"""

import importlib.util
import os
import platform
import shutil
import sys
import sysconfig
from pathlib import Path

OLDEST, NEWEST = (3, 10), (3, 13)


def missing():
    """Return what pip lacks to install the package, one line each."""
    lines = []
    if sys.version_info[:2] < OLDEST:
        oldest = '.'.join(map(str, OLDEST))
        lines.append(
            f'Python is {platform.python_version()}, accepted is {oldest} or newer: '
            'make PYTHON=python3.12 ...'
        )
    if not all(importlib.util.find_spec(name) for name in ('venv', 'ensurepip')):
        lines.append('Python has no venv or no pip: apt install python3-venv')
    return lines


def missing_for_nodes():
    """Return what else is missing to install ROS 2 from PyPI and to compile the messages."""
    lines = []
    if sys.version_info[:2] > NEWEST:
        oldest, newest = ('.'.join(map(str, version)) for version in (OLDEST, NEWEST))
        lines.append(
            f'Python is {platform.python_version()}, ROS 2 on PyPI is for {oldest} to {newest}: '
            'take another one, such as make PYTHON=python3.12 ...'
        )
    if (platform.system(), platform.machine()) != ('Linux', 'x86_64'):
        lines.append(
            f'The machine is {platform.system()} {platform.machine()}, ROS 2 on PyPI is for Linux '
            'x86_64: install ROS 2 and use colcon'
        )
    lacking = []
    if not Path(sysconfig.get_path('include'), 'Python.h').exists():
        lacking.append('python3-dev')
    compilers = (os.environ.get('CC') or 'gcc', os.environ.get('CXX') or 'g++')
    if not all(shutil.which(command.split()[0]) for command in compilers):
        lacking.append('g++')
    if lacking:
        lines.append('The messages cannot be compiled: apt install ' + ' '.join(lacking))
    return lines


if __name__ == '__main__':
    sys.exit('\n'.join(missing() + (missing_for_nodes() if 'nodes' in sys.argv else [])) or 0)
