"""The launch files, read by launch where it is installed, and by a stand-in everywhere."""

import os
import runpy
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('ament_index_python', reason='ROS 2 is not installed')

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.nodes.drivers import DRIVERS
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.scenes.patterns import LIGHT_NAMES
from support import ROOT
from support.launch_files import USERS, Started, launched

NODES = {
    'detector': ['detector'],
    'rig': ['detector', 'pose', 'registration'],
    'demo': ['illumination', 'detector', 'scoreboard'],
}
RIG = {'driver': 'zivid', 'pose': 'true', 'registration': 'true', 'coordinates': 'box.csv'}
REQUIRED = {'detector': {}, 'rig': RIG, 'demo': {}}
DETECTOR_FILE, POSE_FILE, REGISTRATION_FILE = (
    str(ROOT / 'config' / f'{name}.yaml') for name in ('detector', 'pose', 'registration')
)
BEST_EFFORT = (
    'qos_overrides./left/phoxi/phoxi_camera/cloud.subscription_lossless.reliability:=best_effort'
)


@pytest.mark.parametrize('name', NODES)
def test_launch_reads_a_file(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    launch = pytest.importorskip('launch', reason='launch is not installed')
    pytest.importorskip('launch_ros', reason='launch_ros is not installed')
    monkeypatch.delitem(sys.modules, USERS, raising=False)
    file = str(ROOT / 'launch' / f'{name}.launch.py')
    description = runpy.run_path(file)['generate_launch_description']()
    context = launch.LaunchContext()
    context.launch_configurations.update(REQUIRED[name])
    nodes: list[str] = []
    waiting = list(description.entities)
    while waiting:
        entity = waiting.pop(0)
        if hasattr(entity, 'node_package'):
            nodes.append(entity.node_executable)
        else:
            waiting[:0] = entity.visit(context) or []
    assert nodes == NODES[name]


def test_every_launch_file_is_tested() -> None:
    files = {file.name.removesuffix('.launch.py') for file in (ROOT / 'launch').iterdir()}
    assert files == set(NODES)


@pytest.mark.parametrize('name', NODES)
def test_nodes_have_arguments_with_texts_and_end_their_launch(name: str) -> None:
    result = launched(name, **REQUIRED[name])
    assert [it.node for it in result.nodes] == NODES[name]  # on_exit is asserted there
    for argument, declared in result.declared.items():
        description = declared.named['description']
        assert description.endswith('.'), argument
        assert len(description) > 20, argument


@pytest.mark.parametrize('name', ['detector', 'rig'])
def test_usual_parameters_are_arguments(name: str) -> None:
    declared = launched(name, **REQUIRED[name]).declared
    parameters = {item.name: item for item in flat_parameters(DetectorNodeSettings)}
    usual = [parameters[it] for it in declared if it in parameters]
    assert len(usual) >= 10
    assert {'expected_targets', 'detector', 'family', 'queue'} <= set(declared)
    for item in usual:
        named = declared[item.name].named
        assert item.description in named['description']
        assert tuple(named['choices'] or ('',)) == ('', *item.choices)


@pytest.mark.parametrize('of_another_file', [{}, {'threads': '4', 'seed': '7'}])
def test_what_is_no_argument_is_left_to_the_file_of_parameters(
    of_another_file: dict[str, str],
) -> None:
    """Also where another file includes this one."""
    (detector,) = launched('detector', **of_another_file).nodes
    assert '-p' not in detector.arguments
    assert detector.arguments[:2] == ['--params-file', DETECTOR_FILE]


def test_what_is_given_has_the_type_of_the_parameter() -> None:
    given = {'expected_ids': '5', 'expected_targets': '1', 'ahf': 'False', 'max_duration': '2'}
    (detector,) = launched('detector', namespace='left', image='raw', **given).nodes
    assert detector.arguments == [
        *('-r', '__ns:=/left', '--params-file', DETECTOR_FILE),
        *('-p', 'expected_targets:=1', '-p', "expected_ids:='5'"),
        *('-p', 'ahf:=false', '-p', 'max_duration:=2.0'),
        *('-r', 'image:=raw', '-r', 'points:=points'),
    ]


@pytest.mark.parametrize(
    ('name', 'given', 'words'),
    [
        ('detector', {'expected_targets': 'many'}, "expected_targets is 'many', accepted is an"),
        ('detector', {'max_duration': '-1'}, "max_duration is '-1', accepted is a number"),
        ('detector', {'ahf': 'perhaps'}, "ahf is 'perhaps', accepted is true or false"),
        ('detector', {'queue': 'long'}, "queue is 'long', accepted is one of"),
        ('rig', {'driver': 'zivd'}, "driver is 'zivd', accepted is one of"),
        ('demo', {'light': 'foo'}, "light is 'foo', accepted is one of"),
    ],
)
def test_bad_arguments_start_nothing(name: str, given: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        launched(name, **given)


@pytest.mark.parametrize(
    ('name', 'given', 'said'),
    [
        ('detector', 'expected_target', ['expected_targets']),
        ('detector', 'expected', ['expected_targets']),
        ('rig', 'imgae', ['image']),
        ('demo', 'ligth', ['light']),
        ('detector', 'seed', []),
        ('detector', 'ros_namespace', []),
    ],
)
def test_arguments_that_may_be_misspelt_are_said(name: str, given: str, said: list[str]) -> None:
    messages = [f'no argument is named {given}; the nearest is {nearest}' for nearest in said]
    assert launched(name, **REQUIRED[name], **{given: 'some'}).said == messages


def test_arguments_without_effect_are_said() -> None:
    said = launched('rig', driver='zivid', coordinates='box.csv', tf='camera', pose='false').said
    assert said == [
        'coordinates has no effect: pose is false and registration is false',
        'tf has no effect: pose is false',
    ]
    given = {'registration': 'true', 'coordinates': 'box.csv', 'folder': 'scans'}
    assert launched('rig', driver='zivid', **given).said == []


def installed(package: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a package be one that is installed, as far as its name tells."""
    index = folder / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / package).touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(folder), prepend=os.pathsep)


def test_the_rig_starts_its_driver_as_it_has_to_be_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed('realsense2_camera', tmp_path, monkeypatch)
    given = {'driver': 'realsense', 'driver_parameters': DETECTOR_FILE}
    assert [it.node for it in launched('rig', **given).nodes] == ['detector']
    detector, camera = launched('rig', start_driver='true', **given).nodes
    assert detector.node == 'detector'
    assert camera.package == 'realsense2_camera'
    assert camera.node == 'realsense2_camera_node'
    assert camera.arguments == [
        *('-r', '__ns:=/camera', '-r', '__node:=camera', '-p', 'enable_infra1:=true'),
        *('-p', 'pointcloud.enable:=true', '-p', 'pointcloud.ordered_pc:=true'),
        *('--params-file', DETECTOR_FILE),
    ]
    other = {'driver_package': 'realsense2_camera', 'driver_executable': 'other'}
    _, camera = launched('rig', driver='phoxi', start_driver='true', **other).nodes
    assert (camera.package, camera.node) == ('realsense2_camera', 'other')


@pytest.mark.parametrize(
    ('driver', 'words'),
    [
        ('zivid', 'driver_package is zivid_camera, which is not installed or not sourced, accept'),
        ('phoxi', 'driver_executable is empty, .* started by its own `phoxi_camera.launch.py`'),
    ],
)
def test_a_driver_that_cannot_be_started_is_named(driver: str, words: str) -> None:
    with pytest.raises(ValueError, match=f'{words}.*; start_driver:=false starts the rest'):
        launched('rig', driver=driver, start_driver='true')


def test_the_lights_of_the_demo_are_choices() -> None:
    assert tuple(launched('demo').declared['light'].named['choices']) == LIGHT_NAMES


def test_the_rig_registers_scans_and_knows_its_pose() -> None:
    given = {'pose': 'true', 'registration': 'true', 'namespace': 'left', 'unit': 'mm'}
    given |= {'coordinates': 'box.csv', 'tf': 'camera', 'use_sim_time': 'true'}
    for driver, camera_info, of_pose, of_registration in (
        (
            'ensenso',
            '/left/rectified/left/camera_info',
            ['camera_matrix:=p'],
            ['cloud_tolerance:=1e-05'],
        ),
        ('phoxi', 'info', [], ['cloud_tolerance:=0.2', BEST_EFFORT]),
    ):
        own = {'camera_info': 'info'} if driver == 'phoxi' else {}
        _, pose, registration = launched('rig', driver=driver, **given, **own).nodes
        common = ['coordinates:=box.csv', 'unit:=mm', 'use_sim_time:=true']
        assert options(pose) == {
            *('__ns:=/left', 'targets_frame:=registered', 'tf:=camera', *common, *of_pose),
            *(POSE_FILE, f'camera_info:={camera_info}'),
        }
        assert options(registration) == {
            *('__ns:=/left', 'frame:=registered', 'cloud:=true', *common, *of_registration),
            *(REGISTRATION_FILE, 'target_points:=detector/target_points'),
            f'points:=/left{DRIVERS[driver].points}',
            'scan_frame:=left_scan_',
        }


def options(of: Started) -> set[str]:
    """Return what the arguments of a process set, without quotation marks."""
    return {it.replace("'", '') for it in of.arguments[1::2]}


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({}, 'camera_info is empty, accepted with phoxi_camera_ros2 is a topic that somebody'),
        ({'camera_info': 'info', 'tf': 'both'}, "tf is 'both', accepted is one of"),
        ({'camera_info': 'info', 'pose': 'yes'}, "pose is 'yes', accepted is one of"),
    ],
)
def test_a_rig_whose_pose_cannot_be_known_starts_nothing(
    given: dict[str, str], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        launched('rig', **{'driver': 'phoxi', 'pose': 'true', **given})


def test_a_rig_without_a_driver_starts_nothing() -> None:
    with pytest.raises(KeyError):
        launched('rig')


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({}, 'qos_overrides./phoxi/phoxi_camera/texture.subscription.reliability'),
        (
            {'image': 'texture', 'namespace': 'left', 'queue': 'lossless'},
            'qos_overrides./left/texture.subscription_lossless.reliability',
        ),
    ],
)
def test_best_effort_is_for_the_topics_that_are_read(given: dict[str, str], words: str) -> None:
    (detector,) = launched('rig', driver='phoxi', **given).nodes
    assert f"{words}:='best_effort'" in detector.arguments


@pytest.mark.lasting
def test_the_nodes_of_the_demo_work_together(graph: Any) -> None:
    result = launched('demo', light='lattice')
    assert all(Path(file).is_file() for file in result.environment.values())
    small = {
        'illumination': ('width:=640', 'height:=480', 'targets:=6', 'dot_radius:=10', 'rate:=2'),
        'detector': ('family:=metashape12', 'expected_targets:=6', 'image_timeout:=0.0'),
        'scoreboard': ('images:=2',),
    }
    processes = {}
    for item in result.nodes:
        changes = [word for change in small[item.node] for word in ('-p', change)]
        own = ('-r', '__ns:=/demo')
        processes[item.node] = graph.start(item.node, *item.arguments, *own, *changes)
    board = processes['scoreboard']
    assert board.wait() == (0, '')
    assert len(board.output.splitlines()) == 2
    for name in ('illumination', 'detector'):
        assert processes[name].end() == (0, '')
