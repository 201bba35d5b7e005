"""Detectors, and the registry that makes one from its name.

A detector is one file here, with a class made from `DetectorSettings`, and one line below.
"""

from __future__ import annotations

from collections.abc import Callable

from ahf_ros.detectors.detector import Detector, DetectorSettings
from ahf_ros.detectors.ring import RingDetector
from ahf_ros.detectors.traditional import TraditionalDetector
from ahf_ros.parameter import Parameter

__all__ = ['DETECTOR', 'DETECTOR_NAMES', 'Detector', 'DetectorSettings', 'create']

_DETECTORS: dict[str, Callable[[DetectorSettings], Detector]] = {
    'ring': RingDetector,
    'traditional': TraditionalDetector,
}

DETECTOR_NAMES = tuple(_DETECTORS)
"""The accepted names of detectors."""

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
        If there is no such detector, naming those that there are.
    """
    DETECTOR.check(name)
    return _DETECTORS[name](DetectorSettings() if settings is None else settings)
