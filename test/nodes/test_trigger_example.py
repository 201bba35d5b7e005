"""The example of a trigger in docs/examples, with that of a scanner and a detector."""

import csv
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from support import ROOT
from support.launch_files import launched
from support.live import PATIENCE, Graph

pytestmark = pytest.mark.lasting

EXAMPLES = ROOT / 'docs' / 'examples'


def test_every_shot_is_answered(graph: Graph, tmp_path: Path) -> None:
    scanner = runpy.run_path(str(EXAMPLES / 'scanner.py'))
    command = [sys.executable, str(EXAMPLES / 'scanner.py'), str(tmp_path / 'box.csv')]
    published = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        (detector,) = launched('rig', driver='zivid', family='metashape12').nodes
        graph.start(detector.node, *detector.arguments)
        remapped = '--ros-args', '-r', 'camera_info:=/color/camera_info'
        command = [sys.executable, str(EXAMPLES / 'trigger.py'), '2', *remapped]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    finally:
        published.communicate()  # the end of its input
    assert done.returncode == 0, done.stderr
    assert done.stderr == 'shot 1 ok\nshot 2 ok\n'
    rows = list(csv.DictReader(done.stdout.splitlines()))
    assert {row['family'] for row in rows} == {'metashape12'}
    for shot, sides in (('1', (0, 1)), ('2', (1, 2))):
        there = set().union(*(scanner['coordinates'](side) for side in sides))
        assert {int(row['id']) for row in rows if row['shot'] == shot} == there


def test_what_does_not_come_is_named(graph: Graph) -> None:
    cell = runpy.run_path(str(EXAMPLES / 'trigger.py'))['Cell']()
    try:
        with pytest.raises(TimeoutError, match=r'the trigger did not come within 0\.1 s'):
            cell.until('the trigger', 0.1, lambda: None)
    finally:
        cell.destroy_node()


def test_the_example_in_cpp_compiles(tmp_path: Path) -> None:
    """On a ROS installation; the wheels on PyPI have no rclcpp."""
    prefixes = [Path(it) for it in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    folders: list[Any] = [it / 'include' for it in prefixes]
    if not any((it / 'rclcpp' / 'rclcpp' / 'rclcpp.hpp').is_file() for it in folders):
        pytest.skip('rclcpp is not installed')
    compiler = shutil.which('c++') or pytest.skip('there is no C++ compiler')
    included = [f'-I{it}' for folder in folders for it in (folder, *folder.glob('*/'))]
    options = '-std=c++17', '-fsyntax-only', '-Wall', '-Wextra'
    source = str(EXAMPLES / 'trigger.cpp')
    done = subprocess.run([compiler, *options, *included, source], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
