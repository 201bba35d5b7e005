"""The settings of a rendered scene."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ahf_ros.codes.designs import proportions
from ahf_ros.codes.families import FAMILY_NAMES
from ahf_ros.settings.parameter import check_parameters, parameter
from ahf_ros.synthetic.layout import finest_grid, quiet_radius, size_ratios
from ahf_ros.synthetic.patterns import LIGHT_NAMES

CARD_WIDTH = math.cos(math.pi / 8)
"""Width of an eight-sided card, as a share of the distance of its corners."""

_MAXIMUM_SHIFT = 0.35  # of edges, in dot radii: nearly half a sector of the finest ring codes


@dataclass(frozen=True, slots=True)
class SceneSettings:
    """The wall, its light and the camera.

    Examples
    --------
    >>> SceneSettings(targets=6, light='stripe', seed=3).family
    'metashape12'
    """

    width: int = parameter(3984, 'Width of the image, px.', minimum=16, maximum=20000)
    height: int = parameter(2656, 'Height of the image, px.', minimum=16, maximum=20000)
    targets: int = parameter(54, 'Number of coded targets in the image.', minimum=0)
    family: str = parameter('metashape12', 'Family of the codes.', choices=FAMILY_NAMES)
    family_file: str = parameter(
        '', 'Data file that describes the family gsi or dots; empty: the usual design.'
    )
    polarity: str = parameter(
        'dark',
        'Dark targets on white, or bright ones on black.',
        choices=('dark', 'bright'),
    )
    dot_radius: float = parameter(
        20.0, 'Semi-major axis of the central dot in the image, px.', minimum=1.0, maximum=500.0
    )
    radius_spread: float = parameter(
        0.1, 'Largest deviation from the radius, as a fraction of it.', minimum=0.0, maximum=0.5
    )
    sizes: str = parameter(
        '1', 'Sizes of the targets as ratios, mixed in equal numbers, such as 0.5, 1, 2.'
    )
    distractors: int = parameter(
        0, 'Number of marks that are not coded targets: dots, rings, text, leaves.', minimum=0
    )
    pinhole: float = parameter(
        0.05, 'Radius of the hole in the dot, in dot radii.', minimum=0.0, maximum=0.5
    )
    edge_shift: float = parameter(
        0.0,
        'Length by which dark areas of the targets are larger on every edge than the design, px: '
        'the gain of the ink where positive.',
        minimum=-20.0,
        maximum=20.0,
    )
    wall: float = parameter(
        1.0,
        "Reflectance of the wall as a fraction of the targets' ground; below 1, every "
        'target is on an eight-sided card.',
        minimum=0.05,
        maximum=1.0,
    )
    tilt: float = parameter(
        0.0, 'Angle between the optical axis and the wall normal, deg.', minimum=0.0, maximum=80.0
    )
    focal_length: float = parameter(
        1.8, 'Focal length in image widths.', minimum=0.5, maximum=20.0
    )
    distortion: float = parameter(
        0.0, 'Radial lens distortion k1, dimensionless.', minimum=-0.3, maximum=0.3
    )
    light: str = parameter('normal', 'Projected pattern.', choices=LIGHT_NAMES)
    light_scale: float = parameter(1.0, 'Scale of the pattern.', minimum=0.1, maximum=10.0)
    light_turn: float = parameter(0.0, 'Turn of the pattern, deg.', minimum=-180.0, maximum=180.0)
    ambient: float = parameter(
        0.3,
        'Ambient light as a fraction of the projected light.',
        minimum=0.0,
        maximum=10.0,
    )
    phases: int = parameter(
        1,
        'Number of images of the scene, between which the pattern shifts by equal parts of its '
        'period.',
        minimum=1,
        maximum=1000,
    )
    defocus: float = parameter(
        0.5,
        'Blur of the projector, standard deviation in projector px.',
        minimum=0.0,
        maximum=20.0,
    )
    black: float = parameter(
        0.06, 'Reflectance of black as a fraction of white.', minimum=0.0, maximum=1.0
    )
    texture: float = parameter(
        0.02,
        'Unevenness of the paper, relative standard deviation.',
        minimum=0.0,
        maximum=0.2,
    )
    blur: float = parameter(
        0.7, 'Blur of the lens, standard deviation in px.', minimum=0.0, maximum=20.0
    )
    exposure: float = parameter(220.0, 'Mean gray value of lit white.', minimum=1.0, maximum=255.0)
    overexposure: float = parameter(
        1.0,
        'Light on the sensor in multiples of what `exposure` asks for; gray values end at 255.',
        minimum=1.0,
        maximum=1000.0,
    )
    gamma: float = parameter(
        2.2, 'Gray values are light to the power of 1 / gamma.', minimum=0.5, maximum=4.0
    )
    full_well: float = parameter(
        10000.0, 'Photoelectrons at saturation; 0: no noise.', minimum=0.0
    )
    read_noise: float = parameter(4.0, 'Readout noise, electrons.', minimum=0.0, maximum=1000.0)
    seed: int = parameter(
        0, 'Seed of poses, positions, codes, phases and noise.', minimum=0, maximum=2**31 - 1
    )

    def __post_init__(self) -> None:
        """Check each parameter, that the wall fills the image and that the targets fit.

        Raises
        ------
        ValueError
            If not; the message names the field, its value and what is accepted.
        """
        check_parameters(self)
        half_view = math.hypot(self.width, self.height) / 2 / (self.width * self.focal_length)
        half_view += 0.02 / self.focal_length  # the principal point is off the middle
        steepest = math.degrees(math.atan(0.95 / half_view))
        if self.tilt > steepest:
            raise ValueError(
                f'tilt is {self.tilt!r}, accepted is a number from 0 to {steepest:.1f} with a '
                f'focal_length of {self.focal_length:g}'
            )
        strongest = 0.13 / half_view**2  # up to 4/27, distortion is invertible in the image
        if self.distortion < -strongest:
            raise ValueError(
                f'distortion is {self.distortion!r}, accepted is a number of at least '
                f'{-strongest:.3f} with a focal_length of {self.focal_length:g}'
            )
        ratios = size_ratios(self.sizes)
        smallest = self.dot_radius * (1 - self.radius_spread) * min(ratios)
        if abs(self.edge_shift) > _MAXIMUM_SHIFT * smallest:
            most = _MAXIMUM_SHIFT * smallest
            raise ValueError(
                f'edge_shift is {self.edge_shift!r}, accepted is a number from {-most:.3g} to '
                f'{most:.3g} with dots of {smallest:.3g} px'
            )
        largest = self.dot_radius * (1 + self.radius_spread) * max(ratios)
        reach = float(quiet_radius(largest, self.focal_length * self.width, self.free_radius))
        columns, rows = finest_grid(self.width, self.height, reach)
        if self.targets > columns * rows:
            raise ValueError(
                f'targets is {self.targets!r}, accepted is an integer from 0 to {columns * rows} '
                f'with a dot_radius of {self.dot_radius:g} px in {self.width} x {self.height} px'
            )

    @property
    def free_radius(self) -> float:
        """Radius of what is left free about a target, in radii of its dot."""
        zone = proportions(self.family, self.family_file).quiet_zone
        return zone if self.wall == 1 else zone / CARD_WIDTH
