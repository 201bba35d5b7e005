"""Settings of a registration, declared once for the node and for the commands."""

import re
from dataclasses import dataclass
from typing import Any

from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.text import shown
from ahf_ros.network.units import METRES

_FRAME = re.compile(r'[A-Za-z_][\w.-]*(/[\w.-]+)*', re.ASCII)


def unit_parameter() -> Any:
    """Return the field of a unit of coordinates."""
    return parameter(
        '',
        'Unit of the coordinates, needed where their file does not say it.',
        choices=('', *METRES),
        form=f'one of {", ".join(METRES)}, or nothing',
        read_only=True,
    )


@dataclass(frozen=True, slots=True)
class RegistrationSettings:
    """The frame of a registration, and the targets that it rests on."""

    frame: str = parameter(
        'registered',
        'Frame that all scans are registered in.',
        form='the name of a frame, without a slash at its start',
        read_only=True,
    )
    coordinates: str = parameter(
        '',
        'File of known coordinates of targets: a folder of ahf orient, CSV or JSON; empty: the '
        'first scan gives the frame.',
        read_only=True,
        files=True,
    )
    unit: str = unit_parameter()
    minimum_confidence: float = parameter(
        0.9, 'Minimum confidence of targets that are used.', minimum=0.0, maximum=1.0
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        check_frame('frame', self.frame)


def check_frame(name: str, value: str) -> None:
    """Refuse a value that is no name of a frame."""
    if not _FRAME.fullmatch(value):
        accepted = 'the name of a frame, without a slash at its start'
        raise ValueError(f'{name} is {shown(value)}, accepted is {accepted}')
