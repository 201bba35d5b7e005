"""What a detector is, and the settings that every detector of ours understands."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ahf_ros.codes.ring import FAMILY_NAMES
from ahf_ros.codes.square import APRILTAG_NAMES, ARUCO_NAMES
from ahf_ros.settings.parameter import check_parameters, parameter
from ahf_ros.target import Target

POLARITIES = ('auto', 'dark', 'bright')
"""Colour of the dot against its surroundings; 'auto' accepts both in one image."""


class Detector(Protocol):
    """A callable with a name: grayscale image in, targets out. It is the whole contract.

    A detector keeps nothing between calls, may be called from several threads at once and gives
    the same targets for the same image. Nothing but the image given is its input, so a filtered
    image is as good as one that a camera took.

    A detector may also have a method `refine(image, targets)`. It is given the image as received
    and what the detector found in a filtered version of it, and returns the same targets with the
    places that the image as received gives them. With that it may have a method `draft(image)`: as
    a call, but fast, with centres that `refine` can start from. AHF tries filters with it.
    """

    @property
    def name(self) -> str:
        """Name in the registry, and in results."""
        ...

    @property
    def family(self) -> str:
        """Family of the targets that it identifies, in results."""
        ...

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
            Gray values, increasing with light.

        Returns
        -------
        list of Target
            Sorted by ID, undecoded targets first; coordinates in the pixels of `image`.

        Raises
        ------
        ValueError
            If `image` is not a two-dimensional, non-empty array of finite gray values.
        """
        ...


@dataclass(frozen=True, slots=True)
class SquareSettings:
    """Which square markers the detectors `aruco` and `apriltag` look for.

    Attributes
    ----------
    aruco_dictionary, apriltag_dictionary : str
        Names of `ahf_ros.codes.square`.
    """

    aruco_dictionary: str = parameter(
        '4x4_50', 'Dictionary of the detector aruco.', choices=ARUCO_NAMES
    )
    apriltag_dictionary: str = parameter(
        '36h11', 'Dictionary of the detector apriltag.', choices=APRILTAG_NAMES
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class ProgramSettings:
    """Which program the detector `command` runs.

    Attributes
    ----------
    command : str
        Program and arguments, as for a shell, which is not used.
    """

    command: str = parameter(
        '', 'Program of the detector command, with arguments; {image} is the path of a PNG file.'
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """What the targets in the image look like.

    Attributes
    ----------
    family : str
        Name of a family of `ahf_ros.codes.ring`.
    polarity : str
        One of `POLARITIES`.
    min_radius, max_radius : float
        Bounds of the semi-major axis of the dot, px.
    report_undecoded : bool
        Whether targets whose code word is not certain are reported, with the ID `UNDECODED`.
    detector_timeout : float
        Time that a detector from elsewhere has for an image, s.
    square : SquareSettings
        Of detectors of square markers.
    program : ProgramSettings
        Of the detector that is another program.
    """

    family: str = parameter('metashape12', 'Family of the coded targets.', choices=FAMILY_NAMES)
    polarity: str = parameter(
        'auto', 'Colour of the dot: dark on bright, bright on dark, or either.', choices=POLARITIES
    )
    min_radius: float = parameter(4.0, 'Smallest radius of a dot, px.', minimum=1.0, maximum=1e4)
    max_radius: float = parameter(60.0, 'Largest radius of a dot, px.', minimum=1.0, maximum=1e4)
    report_undecoded: bool = parameter(
        False, 'Whether to report targets whose code word is not certain, with the ID -1.'
    )
    detector_timeout: float = parameter(
        60.0,
        'Longest time for one image of a detector that is a command, a service or of another '
        'package, s.',
        minimum=0.01,
        maximum=86400.0,
    )
    square: SquareSettings = field(default_factory=SquareSettings)
    program: ProgramSettings = field(default_factory=ProgramSettings)

    @property
    def signs(self) -> tuple[int, ...]:
        """1 where dots may be dark, -1 where they may be bright."""
        return {'auto': (1, -1), 'dark': (1,), 'bright': (-1,)}[self.polarity]

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        if self.min_radius > self.max_radius:
            raise ValueError(
                f'min_radius is {self.min_radius!r}, accepted is a number of at most max_radius, '
                f'{self.max_radius!r}'
            )
