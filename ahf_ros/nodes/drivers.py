"""Drivers of scanners: what each publishes, and which parameters the node needs for it.

The facts are from the source code of the drivers. The launch file `rig.launch.py`, the table of
docs/rig.md and the tests read them here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

NO_SETTINGS: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Driver:
    """What a driver publishes for one shot, and what the node `detector` needs to know about it.

    All clouds are organised and in metres, with x, y and z as FLOAT32 at 0, 4 and 8.

    Attributes
    ----------
    package : str
        ROS 2 package of the driver.
    image, points : str
        Topics of sensor_msgs/Image and of sensor_msgs/PointCloud2 with the same view.
    encoding : str
        Encoding of the image.
    point_step : int
        Size of a point, bytes.
    missing : str
        What stands for a pixel without a point, `NaN` or `0`.
    cloud_first : bool
        Whether the cloud is published before the image.
    stamps : str
        Where the stamps come from.
    reliable : bool
        Whether the topics are reliable; otherwise they are best effort.
    settings : mapping of str to float
        Parameters of the node `detector`, beside `cloud`.
    setup : str
        What to do in the driver.
    """

    package: str
    image: str
    points: str
    encoding: str
    stamps: str
    setup: str
    point_step: int = 16
    missing: str = 'NaN'
    cloud_first: bool = False
    reliable: bool = True
    settings: Mapping[str, float] = field(default_factory=lambda: NO_SETTINGS)


DRIVERS: Mapping[str, Driver] = MappingProxyType(
    {
        'zivid': Driver(
            package='zivid_camera',
            image='/color/image_color',
            points='/points/xyz',
            encoding='rgba8',
            stamps='the same header',
            cloud_first=True,
            setup='`color_space:=srgb`, because linear images are dark; call `capture`: '
            '`capture_2d` has no cloud',
        ),
        'ensenso': Driver(
            package='ensenso_camera',
            image='/rectified/left/image',
            points='/point_cloud',
            encoding='mono8',
            stamps='the same time; that of the cloud is cut to whole microseconds',
            settings=MappingProxyType({'cloud_tolerance': 1e-5}),
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
            settings=MappingProxyType({'cloud_tolerance': 3.0}),
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
            setup='`enable_infra1:=true pointcloud.enable:=true pointcloud.ordered_pc:=true`; the '
            'cloud has the view of infra1, not that of the colour image, even if their sizes are '
            'equal',
        ),
        'phoxi': Driver(
            package='phoxi_camera_ros2',
            image='/phoxi/phoxi_camera/texture',
            points='/phoxi/phoxi_camera/cloud',
            encoding='32FC1',
            missing='0',
            cloud_first=True,
            stamps='when each is published',
            reliable=False,
            settings=MappingProxyType({'cloud_tolerance': 0.2}),
            setup='`use_texture: True`, `use_pointcloud: True`, `trigger_mode: freerun`',
        ),
    }
)
"""Drivers by the name that the argument `driver` of `rig.launch.py` takes."""
