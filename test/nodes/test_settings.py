"""What the parameters of nodes accept, and those that a node does not have."""

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.nodes.parameters import unknown_parameters
from ahf_ros.nodes.settings import AnswerSettings, DetectorNodeSettings, PoseNodeSettings

KNOWN = [item.name for item in flat_parameters(DetectorNodeSettings)]


def test_a_typing_error_is_named_with_the_nearest_name() -> None:
    assert list(unknown_parameters(['expected_target', 'seed', 'zzz', 'qqq'], KNOWN)) == [
        'no parameter is named expected_target; the nearest is expected_targets',
        'no parameter is named qqq, zzz; is that a parameter of another node?',
    ]
    assert list(unknown_parameters(KNOWN, KNOWN)) == []


def test_what_is_published_needs_its_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('ahf_ros.nodes.settings.find_spec', lambda name: None)
    with pytest.raises(ValueError, match='detections is True and the package vision_msgs is not'):
        PoseNodeSettings(coordinates='a', detections=True)
    with pytest.raises(ValueError, match="tf is 'targets' and the package tf2_msgs is not there"):
        PoseNodeSettings(coordinates='a', tf='targets')
    with pytest.raises(ValueError, match='the package vision_msgs is not there, accepted without'):
        AnswerSettings(detections=True)
    assert PoseNodeSettings(coordinates='a').tf == 'none'
    assert not AnswerSettings(detections=False).detections


@pytest.mark.parametrize(
    ('given', 'words'),
    [
        ({'coordinates': ''}, "coordinates is '', accepted is a folder of ahf orient"),
        ({'targets_frame': '/map'}, "targets_frame is '/map', accepted is a name without spaces"),
        ({'targets_frame': 'a b'}, "targets_frame is 'a b', accepted is a name without spaces"),
        ({'tf': 'map'}, "tf is 'map', accepted is one of none, camera, targets"),
        ({'camera_matrix': 'd'}, "camera_matrix is 'd', accepted is one of k, p"),
        ({'unit': 'px'}, "unit is 'px', accepted is one of m, dm, cm, mm, um, µm, in, ft, or"),
    ],
)
def test_settings_name_what_is_accepted(given: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PoseNodeSettings(**({'coordinates': 'a'} | given))
