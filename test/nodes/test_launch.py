"""The launch files, read by launch where it is installed, and by a stand-in everywhere.

launch is on no package index. The stand-in tells which processes a launch file starts, with which
arguments, and these are then started. What it cannot tell is whether launch accepts the file.
"""

from __future__ import annotations

import runpy
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import pytest

ROOT = Path(__file__).resolve().parents[2]
NODES = {'detector': ['detector'], 'demo': ['illumination', 'detector', 'scoreboard']}


@pytest.mark.parametrize('name', NODES)
def test_launch_reads_a_file(name: str) -> None:
    pytest.importorskip('launch.actions', reason='launch is not installed')
    pytest.importorskip('launch_ros', reason='launch_ros is not installed')
    described = entities(name)
    packages = [getattr(entity, 'node_package', None) for entity in described]
    assert packages.count('ahf_ros') == len(NODES[name])


def entities(name: str) -> list[Any]:
    """Return what a launch file describes."""
    file = str(ROOT / 'launch' / f'{name}.launch.py')
    return runpy.run_path(file)['generate_launch_description']().entities


class Entity:
    """Something of launch: what it was made with."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given = given
        self.named = named


class LaunchDescription(Entity):
    @property
    def entities(self) -> list[Entity]:
        return self.given[0]


STAND_IN: dict[str, dict[str, Any]] = {
    'launch': {'LaunchDescription': LaunchDescription},
    'launch.actions': {},
    'launch.substitutions': {},
    'launch_ros': {},
    'launch_ros.actions': {},
}
for module, name in (
    ('launch.actions', 'DeclareLaunchArgument'),
    ('launch.actions', 'SetEnvironmentVariable'),
    ('launch.substitutions', 'LaunchConfiguration'),
    ('launch.substitutions', 'PathJoinSubstitution'),
    ('launch_ros.actions', 'Node'),
):
    STAND_IN[module][name] = type(name, (Entity,), {})


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the stand-in in the place of launch, and the sources in that of the share folder."""
    packages = pytest.importorskip('ament_index_python.packages', reason='ROS 2 is not installed')
    monkeypatch.setattr(packages, 'get_package_share_directory', lambda _: str(ROOT))
    for name, content in STAND_IN.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)


@dataclass(frozen=True)
class Started:
    """A process that launch starts."""

    node: str
    arguments: list[str]


def started(name: str, **configuration: str) -> tuple[list[Started], dict[str, str]]:
    """Return the processes of a launch file, given its arguments, and their environment."""
    nodes, environment = [], {}
    for entity in entities(name):
        kind = type(entity).__name__
        if kind == 'DeclareLaunchArgument':
            default = text(entity.named['default_value'], configuration)
            configuration.setdefault(entity.given[0], default)
            assert entity.named['description']
        elif kind == 'SetEnvironmentVariable':
            variable, value = entity.given
            environment[variable] = text(value, configuration)
        else:
            nodes.append(process(entity.named, configuration))
    return nodes, environment


def process(node: dict[str, Any], configuration: dict[str, str]) -> Started:
    """Return what launch_ros makes of a node: arguments for its command line."""
    assert node['package'] == 'ahf_ros'
    assert node['output'] == 'screen'
    assert (ROOT / 'scripts' / node['executable']).is_file()
    arguments = []
    namespace = text(node.get('namespace', ''), configuration)
    if namespace:
        arguments += ['-r', f'__ns:=/{namespace}']
    for item in node.get('parameters', []):
        if isinstance(item, dict):
            for name, value in item.items():
                arguments += ['-p', f'{name}:={text(value, configuration)}']
        else:
            arguments += ['--params-file', text(item, configuration)]
    for source, target in node.get('remappings', []):
        arguments += ['-r', f'{source}:={text(target, configuration)}']
    return Started(node['executable'], arguments)


def text(value: Any, configuration: dict[str, str]) -> str:
    """Return what a substitution stands for; those of a list are joined."""
    kind = type(value).__name__
    if kind == 'LaunchConfiguration':
        return configuration[value.given[0]]
    if kind == 'PathJoinSubstitution':
        return str(Path(*(text(part, configuration) for part in value.given[0])))
    if isinstance(value, list):
        return ''.join(text(part, configuration) for part in value)
    return str(value)


@pytest.mark.usefixtures('stand_in')
def test_the_detector_of_a_launch_file_works_in_its_namespace(graph: Any) -> None:
    from sensor_msgs.msg import Image, PointCloud2
    from std_msgs.msg import Header

    from ahf_ros.msg import CodedTargetArray
    from ahf_ros.nodes.image_msg import image_message
    from ahf_ros.synthetic.scene import SceneSettings, render

    given = {'namespace': 'left', 'image': '/left/image_raw', 'points': 'cloud'}
    (detector,), _ = started('detector', **given)
    assert detector.node == 'detector'
    graph.start('detector', *detector.arguments, '-p', 'cloud:=true')
    answers = graph.listen(CodedTargetArray, '/left/coded_targets')
    scene = render(SceneSettings(width=640, height=480, targets=4, dot_radius=10.0))
    graph.publisher(PointCloud2, '/left/cloud')
    graph.publisher(Image, '/left/image_raw').publish(image_message(scene.image, Header()))
    graph.until(lambda: answers)
    assert [it.id for it in answers[0].targets] == [it.id for it in scene.targets]


@pytest.mark.usefixtures('stand_in')
def test_the_detector_of_a_launch_file_reads_compressed_images(graph: Any) -> None:
    from sensor_msgs.msg import CompressedImage

    from ahf_ros.msg import CodedTargetArray
    from ahf_ros.synthetic.scene import SceneSettings, render

    (detector,), _ = started('detector', namespace='right', image='/right/image_raw')
    graph.start('detector', *detector.arguments, '-p', 'image_transport:=compressed')
    answers = graph.listen(CodedTargetArray, '/right/coded_targets')
    scene = render(SceneSettings(width=640, height=480, targets=4, dot_radius=10.0))
    content = cv2.imencode('.png', scene.image)[1].tobytes()
    sent = CompressedImage(format='mono8; png compressed', data=content)
    graph.publisher(CompressedImage, '/right/image_raw/compressed').publish(sent)
    graph.until(lambda: answers)
    assert [it.id for it in answers[0].targets] == [it.id for it in scene.targets]


@pytest.mark.usefixtures('stand_in')
def test_the_nodes_of_the_demo_work_together(graph: Any) -> None:
    nodes, environment = started('demo', light='lattice')
    assert [it.node for it in nodes] == NODES['demo']
    assert all(Path(file).is_file() for file in environment.values())
    small = {
        'illumination': ('width:=640', 'height:=480', 'targets:=6', 'dot_radius:=10', 'rate:=2'),
        'detector': ('expected_targets:=6',),
        'scoreboard': ('images:=2',),
    }
    processes = {}
    for item in nodes:
        changes = [word for change in small[item.node] for word in ('-p', change)]
        own = ('-r', '__ns:=/demo')
        processes[item.node] = graph.start(item.node, *item.arguments, *own, *changes)
    board = processes['scoreboard']
    assert board.wait() == (0, '')
    assert len(board.output.splitlines()) == 2
    for name in ('illumination', 'detector'):
        assert processes[name].end() == (0, '')
