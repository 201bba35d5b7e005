"""What holds for the package as a whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
WITHOUT_ROS = """
import pkgutil, sys

for name in ('rclpy', 'sensor_msgs', 'std_msgs', 'rosidl_runtime_py', 'rosidl_parser'):
    sys.modules[name] = None

import ahf_ros

for module in pkgutil.iter_modules([sys.argv[1]]):
    if module.name not in ('nodes', 'msg', 'srv'):
        __import__(f'ahf_ros.{module.name}')
        print(module.name)
"""


def test_everything_but_the_nodes_works_without_ros() -> None:
    command = [sys.executable, '-c', WITHOUT_ROS, str(ROOT / 'ahf_ros')]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {'bag', 'cli', 'detectors', 'filtering', 'synthetic'} <= set(done.stdout.split())


def test_what_needs_no_ros_among_the_nodes_does_without() -> None:
    program = "import sys; sys.modules['rclpy'] = None; import ahf_ros.nodes.settings"
    subprocess.run([sys.executable, '-c', program], cwd=ROOT, check=True)
