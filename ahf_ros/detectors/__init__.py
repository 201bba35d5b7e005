"""Detectors, and the registry that makes one from its name.

A detector is one file here, with a class made from `DetectorSettings`, and one line below. Other
packages add theirs by entry points of the group `ahf_ros.detectors`: the name of a detector, and a
callable that makes it from `DetectorSettings`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import EntryPoint, entry_points

from ahf_ros.detectors.contract import Detector, DetectorSettings
from ahf_ros.detectors.external.command import CommandDetector
from ahf_ros.detectors.external.guarded import GuardedDetector
from ahf_ros.detectors.ring.detector import RingDetector
from ahf_ros.detectors.ring.traditional import TraditionalDetector
from ahf_ros.detectors.square.detector import SquareDetector
from ahf_ros.settings.parameter import Parameter

__all__ = ['DETECTOR', 'DETECTOR_NAMES', 'GROUP', 'Detector', 'DetectorSettings', 'create']

GROUP = 'ahf_ros.detectors'
"""Group of the entry points by which other packages add detectors."""

_DETECTORS: dict[str, Callable[[DetectorSettings], Detector]] = {
    'ring': RingDetector,
    'traditional': TraditionalDetector,
    'aruco': partial(SquareDetector, 'aruco'),
    'apriltag': partial(SquareDetector, 'apriltag'),
    'command': CommandDetector,
}

_ADDED: dict[str, EntryPoint] = {
    point.name: point for point in entry_points(group=GROUP) if point.name not in _DETECTORS
}

DETECTOR_NAMES = (*_DETECTORS, *sorted(_ADDED))
"""The accepted names of detectors, those of this package first."""

DETECTOR = Parameter('detector', 'ring', 'How targets are identified.', choices=DETECTOR_NAMES)
"""The choice of a detector as a parameter, for the node and the command line."""


def create(name: str, settings: DetectorSettings | None = None) -> Detector:
    """Return the detector called `name`.

    Parameters
    ----------
    name : str
        One of `DETECTOR_NAMES`.
    settings : DetectorSettings, optional
        What the targets look like; the defaults where None.

    Raises
    ------
    ValueError
        If there is no such detector, naming those that there are; if that of another package
        cannot be loaded; or if the detector does not accept the settings.
    """
    DETECTOR.check(name)
    settings = settings or DetectorSettings()
    if name in _DETECTORS:
        return _DETECTORS[name](settings)
    return GuardedDetector(_loaded(_ADDED[name])(settings), settings.detector_timeout)


def _loaded(point: EntryPoint) -> Callable[[DetectorSettings], Detector]:
    try:
        made: Callable[[DetectorSettings], Detector] = point.load()
    except Exception as error:  # whatever the other package does when it is imported
        raise ValueError(
            f'detector is {point.name!r}, but {point.value} cannot be loaded: '
            f'{type(error).__name__}: {error}'
        ) from error
    return made
