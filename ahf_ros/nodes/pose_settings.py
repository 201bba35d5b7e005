"""Settings of the node `pose`; importable without ROS."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.util import find_spec

from ahf_ros.registration_settings import unit_parameter
from ahf_ros.settings.parameter import check_parameters, parameter

NONE, CAMERA, TARGETS = 'none', 'camera', 'targets'
"""Which frame is the parent in tf."""

_FRAME = re.compile(r'[^\s/][^\s]*')


@dataclass(frozen=True, slots=True)
class PoseNodeSettings:
    """Settings of the node `pose`: the coordinates of targets, and what is published."""

    coordinates: str = parameter(
        '',
        'File with the coordinates of the targets: a folder of ahf orient or its network.json, '
        'CSV or JSON.',
        read_only=True,
    )
    unit: str = unit_parameter()
    targets_frame: str = parameter(
        'targets', 'Name of the coordinate frame of the targets.', read_only=True
    )
    tf: str = parameter(
        NONE,
        'Which frame is the parent in tf: camera, with the targets as its child; targets, with '
        'the camera as their child, which must have no other parent; none: no tf.',
        choices=(NONE, CAMERA, TARGETS),
        read_only=True,
    )
    target_frames: bool = parameter(
        False,
        'Whether tf has a child of the camera frame for each target that is used, named '
        'family:ID.',
        read_only=True,
    )
    detections: bool = parameter(
        False,
        'Whether to publish the targets that are used on ~/detections, too, as '
        'vision_msgs/Detection3DArray.',
        read_only=True,
    )
    camera_matrix: str = parameter(
        'k',
        'Matrix of camera_info that images follow: k with the distortion, for images as received; '
        'p, for rectified images.',
        choices=('k', 'p'),
    )
    publish_ambiguous: bool = parameter(
        False, 'Whether to publish the likelier one of two poses that fit about as well, too.'
    )
    centre_deviation: float = parameter(
        0.1,
        'Standard deviation of centres that come without a covariance, px.',
        minimum=0.001,
        maximum=100.0,
    )
    targets_timeout: float = parameter(
        10.0,
        'Time without coded_targets after which the diagnostics warn and say why, s; 0: never.',
        minimum=0.0,
        maximum=86400.0,
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        if not self.coordinates:
            raise ValueError(
                "coordinates is '', accepted is a folder of ahf orient, its network.json, CSV or "
                'JSON with the coordinates of the targets'
            )
        if not _FRAME.fullmatch(self.targets_frame):
            raise ValueError(
                f'targets_frame is {self.targets_frame!r}, accepted is a name without spaces and '
                'without / at its start'
            )
        for wanted, package, name, value in (
            (self.detections, 'vision_msgs', 'detections', 'True'),
            (self.tf != NONE, 'tf2_msgs', 'tf', repr(self.tf)),
            (self.target_frames, 'tf2_msgs', 'target_frames', 'True'),
        ):
            if wanted and find_spec(package) is None:
                without = repr(NONE) if name == 'tf' else 'False'
                raise ValueError(
                    f'{name} is {value} and the package {package} is not there, accepted without '
                    f'it is {without}; ros-DISTRIBUTION-{package.replace("_", "-")} installs it'
                )
