"""What is said at once where something is missing to install the package or to run its nodes."""

import importlib.util
import os
import platform
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from support import ROOT, environment
from support.command_line import python

SCRIPT = ROOT / 'scripts' / 'prerequisites.py'
NO_COMPILER = r'The messages cannot be compiled: apt install (python3-dev )?g\+\+'

WITHOUT_PIP = """
import runpy, sys
sys.modules['ensurepip'] = None
runpy.run_path(sys.argv[1], run_name='__main__')
"""

NODE = """
import sys
sys.path.insert(0, sys.argv[1])
from ahf_ros.nodes.start import detector
sys.exit(detector(['detector']))
"""

needs_wheels = pytest.mark.skipif(
    (platform.system(), platform.machine()) != ('Linux', 'x86_64')
    or not (3, 10) <= sys.version_info[:2] <= (3, 13),
    reason='ROS 2 on PyPI is not for this machine',
)

needs_setuptools = pytest.mark.skipif(
    not importlib.util.find_spec('setuptools'), reason='setuptools is not installed'
)


def without_compiler(*arguments: object) -> subprocess.CompletedProcess[str]:
    variables = environment(PATH=os.devnull)
    for name in ('CC', 'CXX'):
        variables.pop(name, None)
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=variables, cwd=ROOT)


def test_a_python_without_pip_is_said() -> None:
    done = python('-c', WITHOUT_PIP, SCRIPT)
    assert done.returncode == 1
    assert done.stderr == 'Python has no venv or no pip: apt install python3-venv\n'


@needs_wheels
@needs_setuptools
@pytest.mark.parametrize('arguments', [(SCRIPT, 'nodes'), (ROOT / 'ros/setup.py', '--version')])
def test_a_missing_compiler_is_said_in_one_line(arguments: tuple[object, ...]) -> None:
    """By make, and by pip before it looks for wheels of ROS."""
    done = without_compiler(*arguments)
    assert done.returncode == 1
    assert re.fullmatch(NO_COMPILER, done.stderr.strip())


@needs_setuptools
def test_what_is_sourced_is_not_mixed_with_ros_from_pypi() -> None:
    unsourced = runpy.run_path(str(ROOT / 'ros' / 'setup.py'))['unsourced']
    own = '/tmp/build/site'
    path = os.pathsep.join((own, '/opt/ros/humble/lib/python3.10/site-packages'))
    given = {'AMENT_PREFIX_PATH': '/opt/ros/humble', 'PYTHONPATH': path, 'HOME': '/root'}
    assert unsourced(given) == {**given, 'PYTHONPATH': own}
    assert unsourced({'PYTHONPATH': path}) == {'PYTHONPATH': path}


def test_a_ros_of_another_python_is_said(tmp_path: Path) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    package = tmp_path / 'rclpy'
    package.mkdir()
    said = "The C extension 'rclpy/_rclpy.so' isn't present on the system."
    (package / '__init__.py').write_text(f'raise ImportError({said!r} + chr(10) + "more")')
    done = python('-c', NODE, tmp_path)
    assert done.returncode == 1
    assert done.stderr == f'ahf_detector: ROS 2 cannot be used: {said}; see ahf doctor\n'
