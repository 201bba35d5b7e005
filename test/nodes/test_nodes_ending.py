"""Nodes that end, or do not even start: in order, and without a traceback."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.start import NODES
from support import live, packages
from support.detector import DetectorProcess, overrides

SIGNALLED = """
import os, signal, sys
from ahf_ros.nodes.start import start

class Signalling:
    def find_spec(self, name, *_):
        if name == 'rclpy':
            os.kill(os.getpid(), signal.{number})

signal.signal(signal.{number}, signal.SIG_DFL)  # also where the tests run with nohup
sys.meta_path.insert(0, Signalling())
sys.exit(start({node!r}))
"""


GOING_ON = """
import sys, threading
import cv2, numpy as np
from ahf_ros.nodes.start import start

def go_on():
    while True:
        cv2.GaussianBlur(np.zeros((200, 200), np.uint8), (0, 0), 1.0)

for _ in range(4):
    threading.Thread(target=go_on, daemon=True).start()
sys.exit(start('detector', ['--ros-args', '-p', 'expected_targets:=-1']))
"""

WAITING = """
import os, signal, sys, time
from ahf_ros.nodes import process, start
from ahf_ros.nodes.scoreboard import Scoreboard

def wait(self):
    time.sleep(600)

process.ENDING = 1.0
Scoreboard.close = wait
start.signalled()
os.kill(os.getpid(), signal.SIGINT)
sys.exit(process.run(Scoreboard))
"""


def run(*command: str, **environment: str) -> tuple[int, str]:
    """Return exit status and error output of a process."""
    done = subprocess.run(
        [sys.executable, *command],
        env={**os.environ, **live.ros_environment(), **environment},
        capture_output=True,
        text=True,
        timeout=live.PATIENCE,
    )
    return done.returncode, live.errors_of(done.stderr)


@pytest.mark.parametrize(
    ('node', 'number'),
    [('illumination', 'SIGTERM'), pytest.param('detector', 'SIGHUP', marks=pytest.mark.lasting)],
)
def test_a_signal_during_the_imports_ends_in_order(node: str, number: str) -> None:
    assert node in NODES
    assert run('-c', SIGNALLED.format(node=node, number=number)) == (0, '')


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['--params-file', '/nowhere'], "Couldn't parse params file: '--params-file /nowhere'"),
        (['-r', '__ns:=/bad-name'], "Couldn't parse remap rule: '-r __ns:=/bad-name'"),
        (['-p', 'population'], "Couldn't parse parameter override rule: '-p population'"),
        (['-p', 'qos_overrides./image.subscription.reliability:=foo'], 'foo'),
        (
            ['-p', 'expected_ids:=5'],
            'expected_ids is 5, accepted is a text; as a text it is expected_ids:="\'5\'" on',
        ),
    ],
)
def test_what_ros_does_not_accept_is_told_in_a_line(arguments: list[str], reason: str) -> None:
    status, errors = run('-m', 'ahf_ros.nodes', 'detector', '--ros-args', *arguments)
    assert (status, len(errors.splitlines())) == (1, 1), errors
    assert reason in errors


@pytest.mark.lasting
def test_threads_that_go_on_in_the_middle_of_a_call_do_not_change_the_status() -> None:
    status, errors = run('-c', GOING_ON)
    assert (status, len(errors.splitlines())) == (1, 1), errors
    assert 'expected_targets' in errors


def test_a_node_that_does_not_end_says_where_it_waits() -> None:
    status, errors = run('-c', WAITING)
    assert status == 1
    assert 'in wait\n' in errors


def test_a_node_that_has_to_be_secure_and_cannot_be_does_not_run(tmp_path: Path) -> None:
    (tmp_path / 'enclaves' / 'node').mkdir(parents=True)
    status, errors = run(
        *('-m', 'ahf_ros.nodes', 'detector', '--ros-args', '--enclave', '/node'),
        ROS_SECURITY_KEYSTORE=str(tmp_path),
        ROS_SECURITY_ENABLE='true',
        ROS_SECURITY_STRATEGY='Enforce',
    )
    assert status == 1
    assert 'RCLError' in errors.splitlines()[-1]
    assert 'Traceback' not in errors


def test_a_name_that_no_node_has_is_refused() -> None:
    status, errors = run('-m', 'ahf_ros.nodes', 'detektor')
    assert (status, errors) == (1, f'accepted is the name of a node: {", ".join(NODES)}\n')


@pytest.mark.lasting
def test_the_end_does_not_wait_for_a_detector_of_another_package(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = tmp_path / 'mark'
    packages.write_package(tmp_path, 'hanging', packages.SLOW.format(fast=0, mark=str(mark)))
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')
    given = overrides(detector='mine', detector_timeout=600.0, always='true')
    node = graph.start('detector', '-r', '__ns:=/hanging', *given)
    image = graph.publisher(Image, '/hanging/image')
    image.publish(image_message(np.tile(np.arange(40, dtype=np.uint8), (30, 1)), Header()))
    graph.until(mark.exists)
    assert node.end()[0] == 0


LEAVING = """
import os
class MyDetector:
    name = family = 'mine'
    def __init__(self, settings):
        if not os.fork():
            os._exit(0)
        assert os.wait()[1] == 0
    def __call__(self, image):
        os._exit(0)
"""


@pytest.mark.lasting
def test_a_detector_of_another_package_does_not_end_the_node_without_a_word(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages.write_package(tmp_path, 'leaving', LEAVING)
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')
    node = DetectorProcess(graph, '/leaving', '-p', 'detector:=mine')
    node.image.publish(image_message(np.tile(np.arange(40, dtype=np.uint8), (30, 1)), Header()))
    graph.until(lambda: node.told('rejected') == '1')
    reason = "detector 'mine' failed: SystemExit: os._exit(0) would end the process"
    assert node.told('last reason for rejection') == reason
    status, errors = node.process.end()
    assert status == 0
    assert f'image refused: {reason}' in errors
