"""The node `illumination`: synthetic images of targets under projected light, with their truth."""

from collections.abc import Iterator
from itertools import cycle
from typing import NamedTuple

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ahf_ros import msg
from ahf_ros.base.target import Identification
from ahf_ros.files.target_messages import coded_target_array
from ahf_ros.msg import CodedTargetArray
from ahf_ros.nodes.messages import image_message
from ahf_ros.nodes.parameters import ParameterSettings
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.settings import IlluminationNodeSettings
from ahf_ros.scenes.scene import Rendering, SceneSettings, render


class SceneMessages(NamedTuple):
    """The messages of one rendered image, which share a header, in the order of publication."""

    ground_truth: CodedTargetArray
    camera_info: CameraInfo
    image: Image


class IlluminationNode(ProcessNode):
    """Publishes rendered images in turn, each with its truth."""

    def __init__(self) -> None:
        super().__init__('illumination')
        self._settings = ParameterSettings(self, IlluminationNodeSettings, self._restart)
        self._scenes: list[tuple[SceneSettings, int]] = []
        self._messages: Iterator[SceneMessages] = iter(())
        self._outputs = (
            self.publisher(CodedTargetArray, 'ground_truth'),
            self.publisher(CameraInfo, 'camera_info'),
            self.publisher(Image, 'image'),
        )
        # Rendering takes its time and must not block the parameters.
        self._timer = self.create_timer(
            1 / self._settings.current.rate,
            self._publish,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        self._restart()

    def introduction(self) -> str:
        """Return what is rendered, and where it is published."""
        settings, scene = self._settings.current, self._settings.current.scene
        return (
            f'{scene.targets} targets of {scene.family} under {scene.light}, '
            f'{scene.width} x {scene.height} px, {settings.rate:g} Hz, '
            f'images on {self.resolve_topic_name("image")}'
        )

    def _restart(self) -> None:
        """Render and publish as the parameters now say."""
        settings = self._settings.current
        self._timer.timer_period_ns = round(1e9 / settings.rate)
        self._timer.reset()
        if settings.scenes() != self._scenes:
            self._scenes = settings.scenes()
            # Each is rendered once, when it is its turn.
            self._messages = cycle(scene_messages(render(*scene)) for scene in self._scenes)

    def _publish(self) -> None:
        """Publish the image whose turn it is."""
        turns = self._messages
        try:
            messages = next(turns, None)
        except ValueError as error:
            self.get_logger().error(f'nothing to publish: {error}')
            return
        if messages is None or turns is not self._messages:
            return  # the parameters have changed meanwhile
        frame_id = self._settings.current.frame_id
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=frame_id)
        for publisher, message in zip(self._outputs, messages, strict=True):
            message.header = header
            publisher.publish(message)


def scene_messages(rendering: Rendering) -> SceneMessages:
    """Return the messages of a rendered image."""
    family, shape = rendering.settings.family, rendering.image.shape
    truth = Identification(rendering.targets, expected=len(rendering.targets))
    return SceneMessages(
        ground_truth=coded_target_array(truth, family, shape, Header(), msg),
        camera_info=camera_info(rendering),
        image=image_message(rendering.image, Header()),
    )


def camera_info(rendering: Rendering) -> CameraInfo:
    """Return the calibration of the camera of a rendered image."""
    projection = np.hstack((rendering.intrinsics, np.zeros((3, 1))))
    return CameraInfo(
        width=rendering.settings.width,
        height=rendering.settings.height,
        distortion_model='plumb_bob',
        d=[rendering.settings.distortion, 0.0, 0.0, 0.0, 0.0],
        k=rendering.intrinsics.ravel(),
        r=np.eye(3).ravel(),
        p=projection.ravel(),
    )
