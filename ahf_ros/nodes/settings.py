"""Settings of the nodes; importable without ROS."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib.util import find_spec

from ahf_ros.base.extras import missing
from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.text import printable, shown
from ahf_ros.clouds.cloud_settings import MAXIMUM_TOLERANCE, CloudSettings
from ahf_ros.clouds.registration_settings import RegistrationSettings, check_frame, unit_parameter
from ahf_ros.families import DETECTOR, detector_name
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings
from ahf_ros.nodes.patience import CONTINUOUS, TRIGGERED, UNKNOWN
from ahf_ros.prints.families import prints_of
from ahf_ros.scenes.scene import SceneSettings

LATEST, LOSSLESS = 'latest', 'lossless'
"""What becomes of images that arrive while another one is being identified."""

RAW, FFMPEG = 'raw', 'ffmpeg'
IMAGE_TRANSPORTS = RAW, 'compressed', 'zstd', FFMPEG
"""Names of image_transport for what images are sent as."""

PACKAGES = {
    'detections': 'vision_msgs',
    'apriltag_detections': 'apriltag_msgs',
    FFMPEG: 'ffmpeg_image_transport_msgs',
}
"""Which package has the messages that a setting asks for."""

SERVICE = 'service'
"""Name of the detector that calls a service of another node."""

NUMBER_UNKNOWN = 'unknown (expected_targets is 0, expected_ids is empty)'
"""What stands for N in the log where no filter is searched for."""

_SERVICE_NAME = re.compile(r'[~/]?/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)


NONE, CAMERA, TARGETS = 'none', 'camera', 'targets'
"""Which frame is the parent in tf."""

_NAMESPACE = re.compile(r'[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)

_FRAME = re.compile(r'[^\s/][^\s]*')


def check_package(name: str, value: object, package: str, otherwise: str) -> None:
    """Raise a ValueError if the package with the messages is not there that a setting asks for."""
    if find_spec(package) is None:
        raise ValueError(
            f'{name} is {value!r} and the package {package} is not there, accepted without it is '
            f'{otherwise}; ros-DISTRIBUTION-{package.replace("_", "-")} installs it'
        )


@dataclass(frozen=True, slots=True)
class AnswerSettings:
    """Other forms in which answers are published, too."""

    detections: bool = parameter(
        False,
        'Whether to publish the targets on ~/detections, too, as vision_msgs/Detection2DArray.',
    )
    apriltag_detections: bool = parameter(
        False,
        'Whether to publish square markers on ~/apriltag_detections, too, as '
        'apriltag_msgs/AprilTagDetectionArray.',
    )
    undistort: bool = parameter(
        False,
        'Whether to subscribe to camera_info and to publish the targets on ~/undistorted_targets, '
        'too, in the rectified image.',
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        for name in ('detections', 'apriltag_detections'):
            if getattr(self, name):
                check_package(name, True, PACKAGES[name], 'False')


@dataclass(frozen=True, slots=True)
class NodeIdentificationSettings(IdentificationSettings):
    """Settings of an identification whose detector may also be a service of another node."""

    detector: str = parameter(
        DETECTOR.default,
        DETECTOR.description,
        choices=(*DETECTOR.choices, SERVICE),
        read_only=True,
    )

    def check_detector(self) -> None:
        """Refuse a detector that does not identify the family; a service identifies any."""
        if self.detector != SERVICE:
            IdentificationSettings.check_detector(self)


@dataclass(frozen=True, slots=True)
class DetectorNodeSettings:
    """Settings of the node `detector`: the identification, and how images come in."""

    service: str = parameter(
        '', 'Name of the ahf_ros/srv/Identify that the detector service calls.', read_only=True
    )
    allow_programs: bool = parameter(
        False, 'Whether the node may start programs, as the detector command does.', read_only=True
    )
    managed: bool = parameter(
        False,
        'Whether the node has a lifecycle: others configure and activate it.',
        read_only=True,
    )
    autostart: bool = parameter(
        False,
        'Whether a managed node configures and activates itself at its start.',
        read_only=True,
    )
    image_transport: str = parameter(
        RAW,
        'raw: sensor_msgs/Image on image; compressed and zstd: CompressedImage on '
        'image/compressed or image/zstd, which follow a remapped image; ffmpeg: video on '
        'image/ffmpeg, which needs PyAV and ffmpeg_image_transport_msgs.',
        choices=IMAGE_TRANSPORTS,
    )
    queue: str = parameter(
        LATEST,
        'latest: as many images wait as a stack has, and a newer one replaces the oldest; '
        'lossless: every image is answered in order, and the duration in answers is 0.',
        choices=(LATEST, LOSSLESS),
    )
    queue_memory: int = parameter(
        1024,
        'Maximum memory of images waiting in a lossless queue, MB; further ones wait on disk. '
        'Clouds waiting for their image may take as much memory again; the oldest is dropped.',
        minimum=1,
        maximum=10**6,
    )
    stack_timeout: float = parameter(
        5.0,
        'Time without a further image after which a stack is answered with what there is, s.',
        minimum=0.01,
        maximum=86400.0,
    )
    image_timeout: float = parameter(
        10.0,
        'Time without an image that should come, or of an image without its cloud, after which '
        'the diagnostics warn and say why, s; 0: never.',
        minimum=0.0,
        maximum=86400.0,
    )
    acquisition: str = parameter(
        UNKNOWN,
        'When images come. continuous: all the time, silence is a warning; triggered: when the '
        'camera is triggered, silence is none; unknown: silence is one until the first image.',
        choices=(UNKNOWN, TRIGGERED, CONTINUOUS),
    )
    always: bool = parameter(
        False,
        'Whether to identify images also while nobody subscribes to what the node publishes.',
    )
    stacking: StackSettings = field(default_factory=StackSettings)
    identification: NodeIdentificationSettings = field(default_factory=NodeIdentificationSettings)
    answers: AnswerSettings = field(default_factory=AnswerSettings)
    cloud: CloudSettings = field(default_factory=CloudSettings)

    def described(self) -> str:
        """Return what matters most to somebody who starts the node, in words."""
        of = self.identification
        detector = self.service
        if of.detector != SERVICE:
            detector = detector_name(of.detector, of.detection)
        number = str(of.number)
        if not of.number:
            number = 'estimated' if of.estimate_expected else NUMBER_UNKNOWN
        search = of.adaptive.ahf and number != NUMBER_UNKNOWN
        return (
            f'detector {detector}, family {of.detection.family}, N {number}, '
            f'search for a filter {"on" if search else "off"}, queue {self.queue}, '
            f'stack {self.stacking.stack}'
        )

    def ineffective(self) -> Iterator[str]:
        """Yield a message for each value that has no effect beside the others."""
        if self.autostart and not self.managed:
            yield 'autostart has no effect: managed is False'
        detection = self.identification.detection
        if not detection.family_file or any(of.file for of in detection.prints.values()):
            return
        none = f'family_file has no effect: family is {detection.family}'
        try:
            yield f'{none}, and the file describes {", ".join(prints_of(detection.family_file))}'
        except ValueError as error:  # nobody has read it
            yield f'{none}; {printable(str(error))}'

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        if self.image_transport == FFMPEG:
            others = f'one of {", ".join(it for it in IMAGE_TRANSPORTS if it != FFMPEG)}'
            check_package('image_transport', FFMPEG, PACKAGES[FFMPEG], others)
            if lost := missing('video'):
                raise ValueError(f'image_transport is {FFMPEG!r}, accepted is {others}: {lost}')
        if self.service and not _SERVICE_NAME.fullmatch(self.service):
            raise ValueError(f'service is {self.service!r}, accepted is the name of a ROS service')
        if self.identification.detector == 'command' and not self.allow_programs:
            raise ValueError(
                "detector is 'command' and allow_programs is False; accepted with this detector "
                'is True, given when the node starts'
            )
        if self.identification.detector != SERVICE:
            create_identifier(settings=self.identification)
        elif not self.service:
            raise ValueError("service is '', accepted is the name of a ROS service")


@dataclass(frozen=True, slots=True)
class IlluminationNodeSettings:
    """Settings of the node `illumination`: which synthetic images, and how often."""

    rate: float = parameter(1.0, 'Images per second.', minimum=0.001, maximum=1000.0)
    frames: int = parameter(
        3,
        'Number of different scenes, published in turn with all their phases; each has the next '
        'seed.',
        minimum=1,
        maximum=1000,
    )
    frame_id: str = parameter(
        'camera', 'Coordinate frame of the camera, in the header of every image.'
    )
    scene: SceneSettings = field(default_factory=SceneSettings)

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        self.scenes()

    def scenes(self) -> list[tuple[SceneSettings, int]]:
        """Return scene and phase of each image, in the order of publication."""
        return [
            (replace(self.scene, seed=self.scene.seed + number), phase)
            for number in range(self.frames)
            for phase in range(self.scene.phases)
        ]


@dataclass(frozen=True, slots=True)
class ScoreboardSettings:
    """Settings of the node `scoreboard`."""

    images: int = parameter(
        0, 'Number of images after which the node ends; 0: never.', minimum=0, maximum=10**6
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class RegistrationNodeSettings(RegistrationSettings):
    """Settings of the node `registration`: also what is published, kept and written."""

    scanners: str = parameter(
        '',
        'Namespaces of scanners whose scans are registered together, such as left,right: the '
        'topics are then left/detector/target_points and left/points, and so on.',
        form='names with commas between them, or nothing',
        read_only=True,
    )
    scan_frame: str = parameter(
        'scan_',
        'Beginning of the names of the frames of the scans: the first one is scan_1.',
        form='the beginning of the name of a frame, without a slash at its start',
        read_only=True,
    )
    tf: bool = parameter(
        True, 'Whether to publish the frames of all scans on /tf_static.', read_only=True
    )
    cloud: bool = parameter(
        False,
        'Whether to subscribe to clouds on points, to publish them in the frame on ~/cloud, and '
        'to keep them for ~/save.',
        read_only=True,
    )
    cloud_tolerance: float = parameter(
        1e-6,
        'Maximum difference between the stamps of target points and their cloud, s.',
        minimum=0.0,
        maximum=MAXIMUM_TOLERANCE,
        read_only=True,
    )
    cloud_memory: int = parameter(
        4096,
        'Memory for clouds that are kept for ~/save, MB; those beyond are not kept.',
        minimum=0,
        maximum=2**20,
    )
    maximum_scans: int = parameter(
        1000, 'Number of scans beyond which others are refused.', minimum=1, maximum=100_000
    )
    folder: str = parameter('', 'Folder that ~/save writes to.')

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        RegistrationSettings.__post_init__(self)
        check_frame('scan_frame', self.scan_frame)
        names = self.scanner_names
        if self.scanners and not all(map(_NAMESPACE.fullmatch, names)):
            accepted = 'names of namespaces with commas between them, such as left,right'
            raise ValueError(f'scanners is {shown(self.scanners)}, accepted are {accepted}')
        if len(set(names)) < len(names):
            raise ValueError(f'scanners is {shown(self.scanners)}, accepted is each name once')

    @property
    def scanner_names(self) -> tuple[str, ...]:
        """Names of the scanners without slashes at their ends; one is empty if none is named."""
        return tuple(it.strip().strip('/') for it in self.scanners.split(','))


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
        'Time without a publisher of coded_targets that is received, after which the diagnostics '
        'warn and say why, s; 0: never.',
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
            (self.detections, 'vision_msgs', 'detections', True),
            (self.tf != NONE, 'tf2_msgs', 'tf', self.tf),
            (self.target_frames, 'tf2_msgs', 'target_frames', True),
        ):
            if wanted:
                check_package(name, value, package, repr(NONE) if name == 'tf' else 'False')
