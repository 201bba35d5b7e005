"""The layouts of RViz and Foxglove for a rig, against what the nodes publish."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import yaml
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from test_foxglove_layout import leaves
from test_nodes_registration import organised, scan, target_points

from ahf_ros.clouds.registration.session import Registration
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.messages import field_points, residual_points
from ahf_ros.nodes.settings import RegistrationNodeSettings
from support import ROOT

RVIZ = yaml.safe_load((ROOT / 'config' / 'rig.rviz').read_text())['Visualization Manager']
FOXGLOVE = json.loads((ROOT / 'docs' / 'foxglove_rig_layout.json').read_text())
PANELS: dict[str, dict[str, Any]] = FOXGLOVE['configById']
TYPES = {
    'PointCloud2': 'sensor_msgs/PointCloud2',
    'MarkerArray': 'visualization_msgs/MarkerArray',
    'PoseWithCovariance': 'geometry_msgs/PoseWithCovarianceStamped',
    'Image': 'sensor_msgs/Image',
}
"""What displays of RViz show."""

OFFERED = {
    it.name.replace('~', f'/{node}'): it
    for node, about in NODES.items()
    for it in about.interfaces
    if it.use != 'in'
}
SHOWN = {
    *('/registration/cloud', '/registration/targets', '/registration/residuals'),
    *('/registration/transform', '/pose/pose'),
    *('/detector/target_points', '/detector/target_labels', '/detector/debug_image'),
}


@pytest.fixture(scope='module')
def fields() -> dict[str, list[str]]:
    """Return the fields of the clouds, by topic."""
    registration = Registration()
    for number in (0, 1):
        registration.add(scan(number))
    field, header = registration.field, Header()
    clouds: dict[str, PointCloud2] = {
        '/registration/targets': field_points(field, header),
        '/registration/residuals': residual_points(field, field.scans[1], header),
        '/registration/cloud': organised(header),
        '/detector/target_points': target_points(header, scan(0)),
    }
    return {topic: [it.name for it in cloud.fields] for topic, cloud in clouds.items()}


def displays() -> Iterator[tuple[str, dict[str, Any]]]:
    """Return the displays of RViz that have a topic, with it."""
    for display in RVIZ['Displays']:
        if 'Topic' in display:
            yield display['Topic']['Value'], display


def test_rviz_shows_what_the_nodes_publish(fields: dict[str, list[str]]) -> None:
    assert RVIZ['Global Options']['Fixed Frame'] == RegistrationNodeSettings().frame
    assert {topic for topic, _ in displays()} == SHOWN
    for topic, display in displays():
        package, name = display['Class'].split('/')
        assert package == 'rviz_default_plugins'
        assert TYPES[name] == OFFERED[topic].kind
        assert display['Enabled']
        if 'Channel Name' in display:
            assert display['Color Transformer'] == 'Intensity'
            assert display['Channel Name'] in fields[topic]
    assert dict(displays())['/registration/cloud']['Decay Time'] > 3600  # it grows


def test_foxglove_shows_what_the_nodes_publish(fields: dict[str, list[str]]) -> None:
    assert sorted(leaves(FOXGLOVE['layout'])) == sorted(PANELS)
    scene, image = PANELS['3D!rig'], PANELS['Image!debug']
    assert scene['followTf'] == RegistrationNodeSettings().frame
    assert {*scene['topics'], image['imageMode']['imageTopic']} == SHOWN
    for topic, settings in scene['topics'].items():
        if OFFERED[topic].kind == 'sensor_msgs/PointCloud2':
            assert settings['colorField'] in fields[topic]
    assert scene['topics']['/registration/cloud']['decayTime'] > 3600
    assert PANELS['DiagnosticSummary!rig']['topicToRender'] in OFFERED
    called = {it['serviceName'] for it in PANELS.values() if 'serviceName' in it}
    assert called == {
        name
        for name, it in OFFERED.items()
        if it.use == 'service' and name.startswith('/registration/')
    }
