"""Rendered photographs of a wall of coded targets: their settings, and their exact truth."""

import math
import warnings
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.target import Target, TrueTarget, sorted_targets
from ahf_ros.prints.families import ONE, FamilyPrint, print_in
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.prints.prints import Proportions
from ahf_ros.scenes.camera import Camera, Sensor, tilted_camera
from ahf_ros.scenes.covers import card_cover, distractor_cover, ink_cover
from ahf_ros.scenes.layout import (
    Placements,
    finest_grid,
    grid_placements,
    quiet_radius,
    scattered_placements,
    size_ratios,
)
from ahf_ros.scenes.patterns import LIGHT_NAMES, PROJECTOR_PIXELS, light_pattern, turned
from ahf_ros.scenes.prints import Mark, mark_at, print_mark
from ahf_ros.scenes.radiance import paper_texture, rig_projector, wall_radiance

_CARD_WIDTH = math.cos(math.pi / 8)  # of eight sides, as a share of the distance of its corners
_MAXIMUM_SHIFT = 0.35  # of edges, in dot radii: nearly half a sector of the finest ring codes

_PIXEL_DEVIATION = 12**-0.5  # standard deviation of a position inside a pixel, px
_STRIP = 128  # rows exposed at a time, to bound the memory


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
    family: str = parameter('metashape12', 'Family of the codes.', form=ONE)
    family_file: str = parameter(
        '', 'Data files that describe families, as for the detector.', files=True
    )
    polarity: str = parameter(
        'auto',
        'Dark targets on white, or bright ones on black; auto: as the family, dark where it may '
        'be either.',
        choices=('auto', 'dark', 'bright'),
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
        -1.0,
        'Radius of the hole in the dot, in dot radii; -1: that of the family.',
        minimum=-1.0,
        maximum=0.5,
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
    print: FamilyPrint = field(init=False, repr=False, hash=False)

    def __post_init__(self) -> None:
        """Check each parameter, that the wall fills the image and that the targets fit.

        Raises
        ------
        ValueError
            If not; the message names the field, its value and what is accepted.
        """
        check_parameters(self)
        object.__setattr__(self, 'print', print_in(self.family, self.family_file))
        object.__setattr__(self, 'family', self.print.name)
        half_view = _half_view(self.width, self.height, self.focal_length)
        steepest = math.degrees(math.atan(0.95 / half_view))
        if self.tilt > steepest:
            raise ValueError(
                f'tilt is {self.tilt!r}, accepted is a number from 0 to {steepest:.1f} with a '
                f'focal_length of {self.focal_length:g}'
            )
        check_distortion(self)
        ratios = size_ratios(self.sizes)
        smallest = self.dot_radius * (1 - self.radius_spread) * min(ratios)
        most = _MAXIMUM_SHIFT * smallest
        if abs(self.edge_shift) > most:
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
    def proportions(self) -> Proportions:
        """What all targets have in common, in radii of the dot."""
        return self.print.design.proportions.chosen(self.polarity, self.pinhole)

    @property
    def dark(self) -> bool:
        """Whether targets are dark on white."""
        return self.proportions.polarity == 'dark'

    @property
    def free_radius(self) -> float:
        """Radius of what is left free about a target, in radii of its dot."""
        zone = self.proportions.quiet_zone
        return zone if self.wall == 1 else zone / _CARD_WIDTH


def check_distortion(settings: Any) -> None:
    """Refuse distortion that is not invertible in the image, whose limit is at 4/27.

    It is `settings.distortion`, k1; `settings` have the width and height of the image as well, px,
    and the `focal_length` in widths.
    """
    strongest = 0.13 / _half_view(settings.width, settings.height, settings.focal_length) ** 2
    if settings.distortion < -strongest:
        raise ValueError(
            f'distortion is {settings.distortion!r}, accepted is a number of at least '
            f'{-strongest:.3f} with a focal_length of {settings.focal_length:g}'
        )


def drawn_numbers(settings: Any, generator: np.random.Generator) -> list[int]:
    """Return random IDs of the print of some settings, as many as they have targets.

    IDs repeat only if there are more targets than codes.
    """
    design, count = settings.print.design, settings.targets
    # IDs are drawn from those of gsi in the order of its data file
    every = design.numbers if isinstance(design, PointPrint) else design.all_ids
    rounds = -(-count // len(every))
    shuffled = [generator.permutation(every) for _ in range(rounds)]
    return np.concatenate([np.empty(0, int), *shuffled])[:count].tolist()


def _half_view(width: int, height: int, focal_length: float) -> float:
    """Return the largest length of x and y of a ray (x, y, 1) in the image."""
    half_view = math.hypot(width, height) / 2 / (width * focal_length)
    return half_view + 0.02 / focal_length  # the principal point is off the middle


@dataclass(frozen=True, slots=True, eq=False)
class Rendering:
    """An image and its truth.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The photograph.
    targets : tuple of Target
        Sorted by `id`: the projected physical centres and the ellipses of the dots.
    intrinsics : ndarray of float64, shape (3, 3)
        K of the camera; its distortion is k1 = `settings.distortion`.
    settings : SceneSettings
        The settings of the scene.
    """

    image: np.ndarray
    targets: tuple[Target, ...]
    intrinsics: np.ndarray
    settings: SceneSettings

    @property
    def truth(self) -> tuple[TrueTarget, ...]:
        """IDs and centres of `targets`; deprecated, evaluations take a scene or its `targets`."""
        warnings.warn('Rendering.truth is Rendering.targets now', DeprecationWarning, stacklevel=2)
        return tuple(map(TrueTarget.of, self.targets))


@one_blas_thread()
def render(settings: SceneSettings, phase: int = 0) -> Rendering:
    """Return the photograph of a scene; equal arguments give equal images.

    Light is smooth on the scale of a pixel, prints are not. So light is computed once per pixel;
    its product with the prints is supersampled, blurred by the lens and averaged over each pixel.

    Parameters
    ----------
    settings : SceneSettings
        The scene.
    phase : int
        Number of the image, from 0 to `settings.phases` - 1. They differ in light and noise.

    Raises
    ------
    ValueError
        If there is no such phase, or no room for the targets where the wall is seen at less than
        75 degrees, or for the distractors.

    Examples
    --------
    >>> rendering = render(SceneSettings(width=400, height=300, targets=2, dot_radius=12))
    >>> rendering.image.shape, len(rendering.targets)
    ((300, 400), 2)
    """
    if not 0 <= phase < settings.phases:
        raise ValueError(
            f'phase is {phase!r}, accepted is an integer from 0 to {settings.phases - 1}'
        )
    streams = np.random.SeedSequence(settings.seed).spawn(5)
    if phase:
        streams[3] = streams[3].spawn(phase)[-1]
    setup, wall, lamp, noise, clutter = map(np.random.default_rng, streams)
    camera = tilted_camera(
        settings.width,
        settings.height,
        settings.focal_length * settings.width,
        math.radians(settings.tilt),
        settings.distortion,
        setup,
    )
    projector_pixel = settings.dot_radius / PROJECTOR_PIXELS
    projector = rig_projector(camera.pose, projector_pixel, setup)
    cards, marks, targets, placements = _coded_targets(settings, camera, wall)
    distractors = _distractors(settings, camera, placements, clutter)

    softness = math.hypot(settings.defocus, _PIXEL_DEVIATION / projector_pixel)
    size, turn = settings.light_scale, math.radians(settings.light_turn)
    shift = phase / settings.phases
    pattern = turned(light_pattern(settings.light, softness / size, lamp, shift), size, turn)
    average = settings.overexposure * (settings.exposure / 255) ** settings.gamma
    highest = settings.overexposure * ((settings.exposure + 255) / 2 / 255) ** settings.gamma
    light = wall_radiance(camera, projector, pattern, settings.ambient, average, highest, lamp)
    if settings.texture:
        light *= paper_texture(light.shape, settings.texture, settings.dot_radius, wall)
    ground, inked = (1.0, settings.black) if settings.dark else (settings.black, 1.0)
    plain = ground * settings.wall
    image: np.ndarray = light * np.float32(plain)
    if settings.blur:
        image = cv2.GaussianBlur(image, (0, 0), settings.blur, borderType=cv2.BORDER_REPLICATE)
    prints = (cards, ground - plain), (marks, inked - ground), (distractors, inked - plain)
    for printed, change in prints:
        for mark in printed:
            print_mark(image, light, mark, camera, change, settings.blur)
    del light

    sensor = Sensor(settings.full_well, settings.read_noise, settings.gamma)
    grey = np.empty(image.shape, np.uint8)
    for top in range(0, settings.height, _STRIP):
        strip = slice(top, top + _STRIP)
        grey[strip] = sensor.grey_values(image[strip], noise)
    return Rendering(grey, tuple(sorted_targets(targets)), camera.intrinsics, settings)


def _coded_targets(
    settings: SceneSettings, camera: Camera, generator: np.random.Generator
) -> tuple[list[Mark], list[Mark], list[Target], Placements]:
    """Return targets with random positions, sizes, codes and directions, and the cards below.

    Prints are larger where the wall is farther away, so that every dot is about `dot_radius` in
    the image.
    """
    count = settings.targets
    semi_major = settings.dot_radius * (
        1 + settings.radius_spread * generator.uniform(-1, 1, count)
    )
    semi_major *= np.resize(size_ratios(settings.sizes), count)
    turns = generator.uniform(0, 2 * math.pi, count)
    ids = drawn_numbers(settings, generator)
    free = settings.free_radius
    reach = quiet_radius(semi_major, float(camera.intrinsics[0, 0]), free)
    placements = grid_placements(camera, reach, generator)
    gain = settings.edge_shift if settings.dark else -settings.edge_shift

    printed, common = settings.print.design, settings.proportions
    cards, marks, targets = [], [], []
    for number, pixel, size, turn in zip(ids, placements.centres, semi_major, turns, strict=True):
        word, growth = printed.word(number), gain / size
        cover = ink_cover(printed.ink(word, common.pinhole), turn, growth)
        mark = mark_at(camera, pixel, size, common.reach + max(growth, 0.0), cover)
        x, y = camera.project(mark.centre[None])[0].tolist()
        ellipse = camera.circle(mark.centre, common.radius * mark.radius)
        marks.append(mark)
        if settings.wall < 1:
            card = card_cover(free * _CARD_WIDTH, turn)
            cards.append(Mark(mark.centre, mark.radius, free, card))
        targets.append(Target(number, word, x, y, *ellipse, family=settings.family))
    return cards, marks, targets, placements


def _distractors(
    settings: SceneSettings, camera: Camera, taken: Placements, generator: np.random.Generator
) -> list[Mark]:
    """Return distractors that overlap neither each other nor the targets."""
    drawn = [distractor_cover(generator) for _ in range(settings.distractors)]
    radii = np.array([radius for _, radius in drawn]) * settings.dot_radius
    placements = scattered_placements(camera, radii, taken, generator)
    return [
        mark_at(camera, pixel, radius, 1.0, cover)
        for pixel, radius, (cover, _) in zip(placements.centres, radii, drawn, strict=True)
    ]
