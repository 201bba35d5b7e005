"""Arguments and parameter files that have no effect are named, with what may be meant."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('yaml', reason='PyYAML is not installed')

from ahf_ros.nodes.overrides import (
    check_arguments,
    foreign_parameters,
    unknown_arguments,
    unknown_parameters,
)
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.settings.nested import flat_parameters

KNOWN = [item.name for item in flat_parameters(DetectorNodeSettings)]
FILE = """
left:
  camera: {ros__parameters: {width: 3}}
'/**/detector': {ros__parameters: {seed: 1}}
"""


def test_a_typing_error_is_named_with_the_nearest_name() -> None:
    assert list(unknown_parameters(['expected_target', 'seed', 'zzz', 'qqq'], KNOWN)) == [
        'no parameter is named expected_target; the nearest is expected_targets',
        'no parameter is named qqq, zzz; is that a parameter of another node?',
    ]
    assert list(unknown_parameters(KNOWN, KNOWN)) == []


@pytest.mark.parametrize(
    ('arguments', 'meant'),
    [
        (['--expected', '54'], '-p expected_ids:=54 or -p expected_targets:=54'),
        (['-p', 'seeds:=4'], '-p seed:=4'),
        (['queue:=lossless'], '-p queue:=lossless'),
        (['--cloud-radius=2'], '-p cloud_radius:=2'),
        (['--verbose'], '-p NAME:=VALUE'),
    ],
)
def test_arguments_that_ros_does_not_read_are_named(arguments: list[str], meant: str) -> None:
    (text,) = unknown_arguments(arguments, KNOWN)
    shown = ' '.join(arguments)
    assert text == f"argument '{shown}' has no effect; meant may be --ros-args {meant}"


def test_every_argument_is_named_once() -> None:
    found = list(unknown_arguments(['one', '--two', '2', 'three', '--four'], KNOWN))
    assert [text.split("'")[1] for text in found] == ['one', '--two 2', 'three', '--four']


@pytest.mark.parametrize(
    ('node', 'told'), [('/detector', 0), ('/left/detector', 0), ('/left/camera', 0), ('/x', 1)]
)
def test_a_parameter_file_of_other_nodes_is_named(tmp_path: Path, node: str, told: int) -> None:
    file = tmp_path / 'parameters.yaml'
    file.write_text(FILE)
    messages = list(foreign_parameters(['--ros-args', '--params-file', str(file)], node))
    end = f' has no parameters for {node}, only for /left/camera, /**/detector'
    assert messages == [f'{file}{end}'] * told


def test_a_parameter_of_another_node_is_named() -> None:
    given = ['--ros-args', '-p', 'detektor:seed:=4', '-p', 'detector:seed:=4', '-p', 'seed:=4']
    expected = ['detektor:seed:=4 is not for /left/detector, but for detektor']
    assert list(foreign_parameters(given, '/left/detector')) == expected


def test_what_ros_refuses_in_many_lines_is_refused_in_one(tmp_path: Path) -> None:
    check_arguments(['-r', '__ns:=/left/rig_2', '-r', 'node:__ns:=/', '-r', 'image:=/a'])
    with pytest.raises(ValueError, match=f"params-file is '{tmp_path}', accepted is"):
        check_arguments(['--ros-args', '--params-file', str(tmp_path)])
    with pytest.raises(ValueError, match="namespace is '/a-b', accepted are names of letters"):
        check_arguments(['--ros-args', '-r', '__ns:=/a-b'])
