"""The node `detector` with the topics that image_transport puts beside those of the images."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from ahf_ros.files.camera_info import calibration, undistorted
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.illumination import camera_info
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.undistortion import Calibrations
from ahf_ros.scenes.scene import SceneSettings, render
from support.detector import DetectorProcess, overrides

SCENE = SceneSettings(width=1000, height=700, targets=6, distortion=-0.2)


def info(second: int, focal: float = 1000.0, **changes: Any) -> CameraInfo:
    matrix = [focal, 0.0, 500.0, 0.0, focal, 350.0, 0.0, 0.0, 1.0]
    header = Header(stamp=Time(sec=second), frame_id='camera')
    return CameraInfo(header=header, width=1000, height=700, k=matrix, **changes)


def test_an_image_finds_the_calibration_of_its_time() -> None:
    known = Calibrations()
    assert known.at(0) is None
    for second in range(10, 20):
        known.put(info(second))
    known.put(info(20, focal=0.0))
    for second in range(30, 40):
        known.put(info(second, focal=2000.0))
    at = {second: known.at(second * 10**9) for second in (1, 10, 19, 30, 99)}
    assert [int(it.matrix[0, 0]) for it in at.values()] == [1000, 1000, 1000, 2000, 2000]
    assert at[10] is at[19]
    with pytest.raises(ValueError, match='focal lengths 0 and 0'):
        known.at(25 * 10**9)


@pytest.mark.lasting
def test_targets_are_undistorted_where_camera_info_belongs_to_the_image(graph: Any) -> None:
    remapped = '-r', 'image:=/camera/image_raw', *overrides(undistort='true', family=SCENE.family)
    detector = DetectorProcess(graph, '/lens', *remapped, images='/camera/image_raw')
    moved = graph.listen(CodedTargetArray, '/lens/detector/undistorted_targets')
    diagnostics = graph.listen(DiagnosticArray, '/lens/diagnostics')
    calibrations = graph.publisher(CameraInfo, '/camera/camera_info')
    rendering = render(SCENE)

    def answer() -> CodedTargetArray:
        """Return the answer to an image that is newer than all calibrations."""
        image = image_message(rendering.image, Header(frame_id='camera'))
        image.header.stamp = graph.node.get_clock().now().to_msg()
        return detector.answer(image)

    def says(words: str) -> bool:
        """Return whether the node says something soon after it has answered an image."""
        answer()
        count = len(diagnostics)
        graph.until(lambda: len(diagnostics) > count)
        return f'targets are not undistorted: {words}' in diagnostics[-1].status[0].message

    def send(message: CameraInfo) -> None:
        stamp = graph.node.get_clock().now().to_msg()
        message.header = Header(stamp=stamp, frame_id='camera')
        calibrations.publish(message)

    graph.until(lambda: says('no camera_info has come on /camera/camera_info'))
    own, other = camera_info(rendering), camera_info(rendering)
    other.width = 500
    send(other)
    graph.until(lambda: says('camera_info is of an image of 500 x 700 px'))
    assert moved == []
    send(own)
    graph.until(lambda: answer() and moved)
    true = moved[0]
    distorted = next(it for it in detector.targets if it.header == true.header)
    assert [it.id for it in true.targets] == [it.id for it in distorted.targets]
    assert len(true.targets) == SCENE.targets
    raw = np.array([(it.x, it.y) for it in distorted.targets])
    found = np.array([(it.x, it.y) for it in true.targets])
    assert np.abs(found - undistorted(calibration(own), raw)).max() < 1e-9
    assert np.abs(found - raw).max() > 1
    assert detector.set(('image_transport', 'compressed')) == (True, '')
    graph.until(lambda: graph.node.count_subscribers('/camera/image_raw/compressed'))
    assert detector.set(('undistort', False)) == (True, '')
    graph.until(lambda: not graph.node.count_subscribers('/camera/camera_info'))
