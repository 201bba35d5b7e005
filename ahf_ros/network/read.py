"""All that a network is computed from, read in one place."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from ahf_ros.files.exif import Exif, equivalent_in_px, read_exif
from ahf_ros.files.image_files import find_image
from ahf_ros.network.files.camera_files import read_camera
from ahf_ros.network.files.control_files import read_control, read_scale_bars
from ahf_ros.network.files.network_files import CameraKnowledge, make_network, read_cameras
from ahf_ros.network.files.observation_files import ObservedPhotograph, read_observations
from ahf_ros.network.files.robot_files import read_robot_poses, read_stations
from ahf_ros.network.network import Network
from ahf_ros.network.transform import Transform


@dataclass(frozen=True, slots=True)
class NetworkFiles:
    """The files that describe a network, and what they do not say.

    Attributes
    ----------
    observations : str
        Results with image points, or a table of them.
    images : sequence of Path
        Folders that the photographs may have moved to.
    cameras : str
        Table that says which camera took which photograph; empty for none, as below.
    calibrations : sequence of str
        Calibrations of cameras.
    scale_bars, control : str
        Tables of known distances and coordinates.
    robot_poses, stations : str
        Tables of what moved the cameras, or which photographs were taken at once.
    origin : float
        Coordinates that a table has at the centre of the first pixel, px.
    sigma : float
        Standard deviation of image points without covariance, px.
    control_sigma : float
        Standard deviation of control points without one, in `unit`.
    unit : str
        Unit of scale bars and control points.
    focal_length : tuple of float and str, optional
        Start value in 'px' or 'mm', the latter as its equivalent on film.
    adjusted : bool
        Whether given calibrations are adjusted, too.
    equidistant : bool
        Whether lenses are equidistant fisheye ones.
    """

    observations: str
    images: Sequence[Path] = ()
    cameras: str = ''
    calibrations: Sequence[str] = ()
    scale_bars: str = ''
    control: str = ''
    robot_poses: str = ''
    stations: str = ''
    origin: float = 0.0
    sigma: float = 0.1
    control_sigma: float = 0.0
    unit: str = 'mm'
    focal_length: tuple[float, str] | None = None
    adjusted: bool = False
    equidistant: bool = False


@dataclass(frozen=True, slots=True)
class NetworkInputs:
    """What was read: a network, notes for its user, and what moved its cameras, by image."""

    network: Network
    notes: Sequence[str] = ()
    robot_poses: Mapping[str, Transform] = field(default_factory=dict)
    stations: Mapping[str, str] = field(default_factory=dict)


def read_network_inputs(files: NetworkFiles) -> NetworkInputs:
    """Return what the files of a network hold; a ValueError names what cannot be used."""
    photographs = read_observations(files.observations, files.origin)
    network, notes = make_network(
        photographs,
        _cameras(photographs, files),
        read_scale_bars(files.scale_bars) if files.scale_bars else (),
        read_control(files.control, files.control_sigma) if files.control else (),
        unit=files.unit,
        sigma=files.sigma,
    )
    return NetworkInputs(
        network,
        notes,
        read_robot_poses(files.robot_poses) if files.robot_poses else {},
        read_stations(files.stations) if files.stations else {},
    )


def _cameras(photographs: Sequence[ObservedPhotograph], files: NetworkFiles) -> CameraKnowledge:
    exif, sizes = _noted(photographs, files)
    return CameraKnowledge(
        names=read_cameras(files.cameras) if files.cameras else {},
        exif=exif,
        sizes=sizes,
        calibrations=[read_camera(path) for path in files.calibrations],
        adjusted=files.adjusted,
        focal_length=files.focal_length and _in_px(*files.focal_length),
        equidistant=files.equidistant,
    )


def _noted(
    photographs: Sequence[ObservedPhotograph], files: NetworkFiles
) -> tuple[dict[str, Exif], dict[str, tuple[int, int]]]:
    """Return Exif data and sizes of the photographs that are at hand."""
    exif, sizes = {}, {}
    source = Path(files.observations)
    for photograph in photographs:
        with suppress(ValueError):  # what is not there, or no image, says nothing
            path = find_image(photograph.path, source, files.images)
            found, size = read_exif(path)
            exif[photograph.path] = found
            if all(size):
                sizes[photograph.path] = size
    return exif, sizes


def _in_px(number: float, unit: str) -> Callable[[int, int], float]:
    if unit == 'px':
        return lambda width, height: number
    return lambda width, height: equivalent_in_px(number, width, height)
