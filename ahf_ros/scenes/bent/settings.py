"""The settings of pictures of bent sheets."""

import math
from dataclasses import dataclass, field, fields
from typing import Any

from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.prints.families import FamilyPrint, print_in
from ahf_ros.prints.prints import Proportions
from ahf_ros.scenes.layout import finest_grid, quiet_radius
from ahf_ros.scenes.scene import SceneSettings, check_distortion

STEEPEST = 75.0
"""Largest angle between the view and the normal of a sheet at a target, degrees."""

_GAP = 1.05  # width of a cell of a sheet over that of a target with what is left free about it


def _shared(name: str) -> Any:
    """Return the field of a parameter that both makers have."""
    of = next(item for item in fields(SceneSettings) if item.name == name)
    return field(default=of.default, metadata=of.metadata)


@dataclass(frozen=True, slots=True)
class BentSettings:
    """Sheets of targets that are bent, their light and the camera.

    Parameters that `SceneSettings` has, too, mean the same. The dots of a sheet are as large in
    the image as their distance makes them: `dot_radius` is that at its middle.

    Examples
    --------
    >>> BentSettings(targets=6, light='stripe', seed=3).family
    'metashape12'
    """

    width: int = _shared('width')
    height: int = _shared('height')
    targets: int = _shared('targets')
    family: str = _shared('family')
    family_file: str = _shared('family_file')
    polarity: str = _shared('polarity')
    dot_radius: float = _shared('dot_radius')
    radius_spread: float = _shared('radius_spread')
    pinhole: float = _shared('pinhole')
    focal_length: float = _shared('focal_length')
    distortion: float = _shared('distortion')
    light: str = _shared('light')
    light_scale: float = _shared('light_scale')
    light_turn: float = _shared('light_turn')
    ambient: float = _shared('ambient')
    defocus: float = _shared('defocus')
    black: float = _shared('black')
    texture: float = _shared('texture')
    blur: float = _shared('blur')
    exposure: float = _shared('exposure')
    full_well: float = _shared('full_well')
    read_noise: float = _shared('read_noise')
    seed: int = _shared('seed')
    sheets: int = parameter(6, 'Number of sheets that the targets are on.', minimum=1, maximum=100)
    printed_radius: float = parameter(
        4.0, 'Radius of the dot on paper, mm.', minimum=0.1, maximum=1000.0
    )
    bend_radius: float = parameter(
        100.0, 'Smallest radius that sheets are bent to, mm.', minimum=1.0, maximum=1e9
    )
    bend_ratio: float = parameter(
        5.0, 'Largest radius over the smallest; each sheet has its own.', minimum=1.0, maximum=1e3
    )
    lean: float = parameter(
        20.0, 'Largest tilt of the middle of a sheet, deg.', minimum=0.0, maximum=70.0
    )
    gloss: float = parameter(
        0.04,
        'Share of light that the surface mirrors at normal incidence: 0.04 of varnish, 0: none.',
        minimum=0.0,
        maximum=0.5,
    )
    roughness: float = parameter(
        0.35,
        'Roughness of the surface, by which highlights spread: 0.1 shiny, 0.6 matt.',
        minimum=0.05,
        maximum=1.0,
    )
    grain: float = parameter(
        0.05,
        'Unevenness of the toner, standard deviation as a fraction of its contrast.',
        minimum=0.0,
        maximum=0.5,
    )
    grain_size: float = parameter(
        0.2, 'Size of the grains of toner and of paper, mm.', minimum=0.01, maximum=10.0
    )
    ragged: float = parameter(
        0.02,
        'Standard deviation of the edges of ink from the design, mm.',
        minimum=0.0,
        maximum=1.0,
    )
    background: float = parameter(
        0.4,
        "Reflectance of what is behind, as a fraction of the paper's.",
        minimum=0.0,
        maximum=1.0,
    )
    tangential_1: float = parameter(
        0.0, 'Tangential lens distortion p1, dimensionless.', minimum=-0.02, maximum=0.02
    )
    tangential_2: float = parameter(
        0.0, 'Tangential lens distortion p2, dimensionless.', minimum=-0.02, maximum=0.02
    )
    vignetting: float = parameter(
        0.3, 'Share of the light that is lost in the corners.', minimum=0.0, maximum=0.95
    )
    confusion: float = parameter(
        0.5, "Radius of a point in the camera's defocus, px.", minimum=0.0, maximum=20.0
    )
    motion: float = parameter(
        1.0, 'Path of the image during the exposure, px.', minimum=0.0, maximum=20.0
    )
    print: FamilyPrint = field(init=False, repr=False, hash=False)

    def __post_init__(self) -> None:
        """Check each parameter, that the lens is invertible and that the sheets fit.

        Raises
        ------
        ValueError
            If not; the message names the field, its value and what is accepted.
        """
        check_parameters(self)
        object.__setattr__(self, 'print', print_in(self.family, self.family_file))
        object.__setattr__(self, 'family', self.print.name)
        check_distortion(self)
        every = (self.fits(count) for count in range(1, self.on_sheet + 1))
        if not all(fitting := list(every)):
            most = fitting.index(False) * self.sheets
            raise ValueError(
                f'targets is {self.targets!r}, accepted is an integer from 0 to {most} on '
                f'{self.sheets} sheets with a dot_radius of {self.dot_radius:g} px in '
                f'{self.width} x {self.height} px'
            )
        most_bent = math.radians(STEEPEST - self.lean)
        reach = self.half_diagonal(self.on_sheet) - self.cell / math.sqrt(2)
        if reach > most_bent * self.bend_radius:
            raise ValueError(
                f'bend_radius is {self.bend_radius!r}, accepted is a number of at least '
                f'{reach / most_bent:.4g} mm with {self.on_sheet} targets on a sheet, a '
                f'printed_radius of {self.printed_radius:g} mm and a lean of {self.lean:g} deg'
            )

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common, in radii of the dot."""
        return self.print.design.proportions.chosen(self.polarity, self.pinhole)

    @property
    def dark(self) -> bool:
        """Whether targets are dark on white."""
        return self.proportions.polarity == 'dark'

    @property
    def focal_pixels(self) -> float:
        """Focal length, px."""
        return self.focal_length * self.width

    @property
    def distance(self) -> float:
        """Distance at which a dot has the radius `dot_radius` in the image, mm."""
        return self.focal_pixels * self.printed_radius / self.dot_radius

    @property
    def on_sheet(self) -> int:
        """Number of targets that there is room for on each sheet."""
        return max(math.ceil(self.targets / self.sheets), 1)

    @property
    def cell(self) -> float:
        """Side of the cells that targets are printed in, mm."""
        return 2 * _GAP * self.proportions.quiet_zone * self.printed_radius

    def half_diagonal(self, count: int) -> float:
        """Return half of the diagonal of a sheet of so many targets, mm."""
        return math.hypot(*sheet_grid(count)) * self.cell / 2

    def sheet_reach(self, count: int) -> float:
        """Return the radius of the circle that a sheet of so many targets stays in, px."""
        scale = self.dot_radius * (1 + self.radius_spread) / self.printed_radius
        return float(quiet_radius(scale * self.half_diagonal(count), self.focal_pixels, 1.0))

    def fits(self, count: int) -> bool:
        """Return whether there is room in the image for all sheets with so many targets each."""
        columns, rows = finest_grid(self.width, self.height, self.sheet_reach(count))
        return columns * rows >= self.sheets


def sheet_grid(count: int) -> tuple[int, int]:
    """Return the columns and rows of cells on a sheet of so many targets."""
    columns = math.ceil(math.sqrt(count))
    return columns, math.ceil(count / columns)
