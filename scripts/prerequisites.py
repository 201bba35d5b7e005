"""Say at once what a machine lacks to build ahf_ros with pip, not in a page of compiler output.

Runs on any Python from 3.6, also on one that is too old for the package.
"""

import importlib.util
import platform
import shutil
import sys
import sysconfig
from pathlib import Path

OLDEST, NEWEST = (3, 10), (3, 13)


def missing():
    """Return what is missing, one line each."""
    lines = []
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        oldest, newest = ('.'.join(map(str, version)) for version in (OLDEST, NEWEST))
        lines.append(
            f'Python is {platform.python_version()}, accepted is {oldest} to {newest}: '
            'make PYTHON=python3.12 ...'
        )
    if (platform.system(), platform.machine()) != ('Linux', 'x86_64'):
        lines.append(
            f'The machine is {platform.system()} {platform.machine()}, ROS 2 on PyPI is for Linux '
            'x86_64: install ROS 2 and use colcon'
        )
    if not all(importlib.util.find_spec(name) for name in ('venv', 'ensurepip')):
        lines.append('Python has no venv module: apt install python3-venv')
    if not Path(sysconfig.get_path('include'), 'Python.h').exists():
        lines.append('Python has no headers: apt install python3-dev')
    if not all(shutil.which(name) for name in ('gcc', 'g++')):
        lines.append('There is no C and C++ compiler: apt install g++')
    return lines


if __name__ == '__main__':
    sys.exit('\n'.join(missing()) or 0)
