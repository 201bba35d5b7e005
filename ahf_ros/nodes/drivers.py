"""Drivers of scanners: what each publishes, and which parameters the node needs for it.

The facts are from the source code of the drivers. The launch file `rig.launch.py`, the table of
docs/rig.md and the tests read them here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ahf_ros.nodes.patience import CONTINUOUS, TRIGGERED


@dataclass(frozen=True, slots=True)
class Driver:
    """How a driver is started, what it publishes for one shot, and what the detector needs for it.

    All clouds are organised and in metres, with x, y and z as FLOAT32 at 0, 4 and 8.
    """

    package: str
    image: str  # topic of sensor_msgs/Image
    points: str  # topic of sensor_msgs/PointCloud2 with the same view
    encoding: str  # of the image
    stamps: str  # where they come from
    setup: str  # what else to do in the driver
    executable: str = ''  # of the package; empty if only a launch file of its own starts it
    node: str = ''  # full name that its topics need; empty: its own
    parameters: Mapping[str, bool | str] = field(default_factory=dict)  # of the driver
    point_step: int = 16  # bytes
    missing: str = 'NaN'  # what stands for a pixel without a point, or 0
    cloud_first: bool = False  # whether the cloud is published before the image
    reliable: bool = True  # otherwise, the topics are best effort
    settings: Mapping[str, float] = field(default_factory=dict)  # of the node, beside cloud
    calibrated: bool = True  # whether it publishes camera_info, beside the image
    pose: Mapping[str, str] = field(default_factory=dict)  # settings of the node `pose`
    acquisition: str = TRIGGERED
    frames: Mapping[str, str] = field(
        default_factory=dict
    )  # its parameters that name them, with {}
    remappings: Mapping[str, str] = field(default_factory=dict)  # of its topics

    def within(self, namespace: str) -> Driver:
        """Return the driver in a namespace: its topics, its node and its frames are there.

        A topic whose name begins with a slash in its sources is remapped; others follow the node.
        """
        if not (space := namespace.strip('/')):
            return self
        topics = {it: f'/{space}{it}' for it in (self.image, self.points, self.camera_info) if it}
        name = space.replace('/', '_')
        return replace(
            self,
            image=topics[self.image],
            points=topics[self.points],
            node=f'/{space}{self.node or "/"}',
            parameters={
                **self.parameters,
                **{key: form.format(name) for key, form in self.frames.items()},
            },
            remappings=topics,
        )

    @property
    def camera_info(self) -> str:
        """Topic of sensor_msgs/CameraInfo; empty if there is none."""
        return beside(self.image) if self.calibrated else ''


def beside(image: str) -> str:
    """Return the topic where image_transport publishes the calibration of an image."""
    space, slash, _ = image.rpartition('/')
    return f'{space}{slash}camera_info'


DRIVERS = {
    'zivid': Driver(
        package='zivid_camera',
        image='/color/image_color',
        points='/points/xyz',
        encoding='rgba8',
        stamps='the same header',
        cloud_first=True,
        executable='zivid_camera',
        parameters={'color_space': 'srgb'},
        frames={'frame_id': '{}_optical_frame'},
        setup='linear images are dark; call `capture`: `capture_2d` has no cloud',
    ),
    'ensenso': Driver(
        package='ensenso_camera',
        image='/rectified/left/image',
        points='/point_cloud',
        encoding='mono8',
        stamps='the same time; that of the cloud is cut to whole microseconds',
        settings={'cloud_tolerance': 1e-5},
        pose={'camera_matrix': 'p'},  # k is the identity
        executable='ensenso_camera_node',
        frames={'camera_frame': '{}_optical_frame'},
        setup='request rectified images and the point cloud together; with a disparity map '
        'offset, the cloud is narrower than the image by `cloud_offset_x`',
    ),
    'mechmind': Driver(
        package='mecheye_ros_interface',
        image='/mechmind/color_image',
        points='/mechmind/point_cloud',
        encoding='bgr8',
        point_step=12,
        stamps='when each is published, by services of their own',
        settings={'cloud_tolerance': 3.0},
        executable='start',
        setup='call `capture_color_image`, then `capture_point_cloud` within 3 s, and move '
        'nothing meanwhile; `cloud_step` if the image is larger',
    ),
    'realsense': Driver(
        package='realsense2_camera',
        image='/camera/camera/infra1/image_rect_raw',
        points='/camera/camera/depth/color/points',
        encoding='mono8',
        point_step=20,
        missing='0',
        stamps='those of one set of frames',
        acquisition=CONTINUOUS,
        frames={'camera_name': '{}'},
        executable='realsense2_camera_node',
        node='/camera/camera',
        parameters={
            'enable_infra1': True,
            'pointcloud.enable': True,
            'pointcloud.ordered_pc': True,
        },
        setup='the cloud has the view of infra1, not that of the colour image, even if their '
        'sizes are equal',
    ),
    'phoxi': Driver(
        package='phoxi_camera_ros2',
        image='/phoxi/phoxi_camera/texture',
        points='/phoxi/phoxi_camera/cloud',
        encoding='32FC1',
        calibrated=False,
        acquisition=CONTINUOUS,
        missing='0',
        cloud_first=True,
        stamps='when each is published',
        reliable=False,
        settings={'cloud_tolerance': 0.2},
        parameters={'use_texture': True, 'use_pointcloud': True, 'trigger_mode': 'freerun'},
        setup='started by its own `phoxi_camera.launch.py`, which configures and activates it',
    ),
}
"""Drivers by the name that the argument `driver` of `rig.launch.py` takes."""
