"""Images of a wall of ring targets, with exact truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.codes.ring import FAMILY_NAMES, family
from ahf_ros.codes.square import SQUARE_NAMES, dictionary
from ahf_ros.settings.parameter import check_parameters, parameter
from ahf_ros.synthetic.camera import Camera, Sensor, tilted_camera
from ahf_ros.synthetic.distractors import distractor_cover
from ahf_ros.synthetic.layout import (
    Places,
    finest_grid,
    grid_places,
    quiet_radius,
    scattered_places,
)
from ahf_ros.synthetic.lighting import paper_texture, white_light
from ahf_ros.synthetic.lights import LIGHT_NAMES, light_pattern
from ahf_ros.synthetic.prints import Cover, Mark, print_mark, ring_cover, square_cover
from ahf_ros.synthetic.projector import rig_projector
from ahf_ros.target import Target, TrueTarget

_PROJECTOR_PIXELS = 6.4  # in the radius of a dot
_PIXEL_DEVIATION = 12**-0.5  # of a place in a pixel, px
_STRIP = 128  # rows exposed at a time
_HALF_SIDE = 2.4  # of a square marker, in radii of the dot of a ring target as large


@dataclass(frozen=True, slots=True)
class SceneSettings:
    """What is on the wall, how it is lit and how it is photographed."""

    width: int = parameter(3984, 'Width of the image, px.', minimum=16, maximum=20000)
    height: int = parameter(2656, 'Height of the image, px.', minimum=16, maximum=20000)
    targets: int = parameter(54, 'Number of coded targets in the image.', minimum=0)
    family: str = parameter(
        'metashape12', 'Family of the codes.', choices=(*FAMILY_NAMES, *SQUARE_NAMES)
    )
    polarity: str = parameter(
        'dark', 'Dark targets on white, or bright ones on black.', choices=('dark', 'bright')
    )
    dot_radius: float = parameter(
        20.0, 'Semi-major axis of the middle dot in the image, px.', minimum=1.0, maximum=500.0
    )
    radius_spread: float = parameter(
        0.1, 'Largest deviation of a radius, as a share of it.', minimum=0.0, maximum=0.5
    )
    distractors: int = parameter(
        0, 'Number of marks that are no coded targets: dots, rings, writing, leaves.', minimum=0
    )
    pinhole: float = parameter(
        0.05, 'Radius of the hole in the dot, in dot radii.', minimum=0.0, maximum=0.5
    )
    tilt: float = parameter(
        0.0, 'Angle between the optical axis and the wall normal, deg.', minimum=0.0, maximum=75.0
    )
    focal_length: float = parameter(
        1.8, 'Focal length in widths of the image.', minimum=0.5, maximum=20.0
    )
    distortion: float = parameter(
        0.0, 'Radial lens distortion k1, dimensionless.', minimum=-0.3, maximum=0.3
    )
    light: str = parameter('normal', 'Pattern of the projector.', choices=LIGHT_NAMES)
    ambient: float = parameter(
        0.3, 'Ambient light as a share of the light of the projector.', minimum=0.0, maximum=10.0
    )
    defocus: float = parameter(
        0.5,
        'Blur of the projector, standard deviation in px of the projector.',
        minimum=0.0,
        maximum=20.0,
    )
    black: float = parameter(
        0.06, 'Reflectance of black as a share of white.', minimum=0.0, maximum=1.0
    )
    texture: float = parameter(
        0.02, 'Unevenness of the paper, standard deviation as a share.', minimum=0.0, maximum=0.2
    )
    blur: float = parameter(
        0.7, 'Blur of the lens, standard deviation in px.', minimum=0.0, maximum=20.0
    )
    exposure: float = parameter(220.0, 'Grey value of lit white.', minimum=1.0, maximum=255.0)
    gamma: float = parameter(
        2.2, 'Grey value = light to the power of 1 / gamma.', minimum=0.5, maximum=4.0
    )
    full_well: float = parameter(
        10000.0, 'Photo-electrons at saturation, 0: no noise.', minimum=0.0
    )
    read_noise: float = parameter(
        4.0, 'Noise of the readout, electrons.', minimum=0.0, maximum=1000.0
    )
    seed: int = parameter(
        0, 'Seed of poses, places, codes, phases, noise.', minimum=0, maximum=2**31 - 1
    )

    def __post_init__(self) -> None:
        """Check each parameter, that the wall fills the view and that it holds the targets.

        Raises
        ------
        ValueError
            Naming the field, its value and what is accepted.
        """
        check_parameters(self)
        half_view = math.hypot(self.width, self.height) / 2 / (self.width * self.focal_length)
        half_view += 0.02 / self.focal_length  # the principal point is not quite in the middle
        steepest = math.degrees(math.atan(0.95 / half_view))
        if self.tilt > steepest:
            raise ValueError(
                f'tilt is {self.tilt!r}, accepted is a number from 0 to {steepest:.1f} with a '
                f'focal_length of {self.focal_length:g}'
            )
        strongest = 0.13 / half_view**2  # below 4/27 the view is one to one
        if self.distortion < -strongest:
            raise ValueError(
                f'distortion is {self.distortion!r}, accepted is a number of at least '
                f'{-strongest:.3f} with a focal_length of {self.focal_length:g}'
            )
        largest = self.dot_radius * (1 + self.radius_spread)
        reach = float(quiet_radius(largest, self.focal_length * self.width))
        columns, rows = finest_grid(self.width, self.height, reach)
        if self.targets > columns * rows:
            raise ValueError(
                f'targets is {self.targets!r}, accepted is an integer from 0 to {columns * rows} '
                f'with a dot_radius of {self.dot_radius:g} in {self.width} x {self.height} px'
            )


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
        What was rendered.
    """

    image: np.ndarray
    targets: tuple[Target, ...]
    intrinsics: np.ndarray
    settings: SceneSettings

    @property
    def truth(self) -> tuple[TrueTarget, ...]:
        """IDs and centres of the targets, for `ahf_ros.evaluation`."""
        return tuple(map(TrueTarget.of, self.targets))


def render(settings: SceneSettings) -> Rendering:
    """Return the photograph of a scene; the same settings always give the same image.

    Light is smooth on the scale of a pixel, prints are not: light is computed once a pixel, and
    its product with the prints is supersampled, blurred by the lens and averaged over each pixel.

    Raises
    ------
    ValueError
        If there is no room for the targets where the wall is seen at less than 75 degrees, or
        for the distractors.
    """
    setup, wall, lamp, noise, clutter = (
        np.random.default_rng(stream) for stream in np.random.SeedSequence(settings.seed).spawn(5)
    )
    camera = tilted_camera(
        settings.width,
        settings.height,
        settings.focal_length * settings.width,
        math.radians(settings.tilt),
        settings.distortion,
        setup,
    )
    projector_pixel = settings.dot_radius / _PROJECTOR_PIXELS
    projector = rig_projector(camera.pose, projector_pixel, setup)
    marks, targets, places = _coded_targets(settings, camera, wall)
    marks += _distractors(settings, camera, places, clutter)

    softness = math.hypot(settings.defocus, _PIXEL_DEVIATION / projector_pixel)
    pattern = light_pattern(settings.light, softness, lamp)
    average = (settings.exposure / 255) ** settings.gamma
    highest = ((settings.exposure + 255) / 2 / 255) ** settings.gamma
    light = white_light(camera, projector, pattern, settings.ambient, average, highest, lamp)
    if settings.texture:
        light *= paper_texture(light.shape, settings.texture, settings.dot_radius, wall)
    ground, inked = (1.0, settings.black) if settings.polarity == 'dark' else (settings.black, 1.0)
    image: np.ndarray = light * np.float32(ground)
    if settings.blur:
        image = cv2.GaussianBlur(image, (0, 0), settings.blur, borderType=cv2.BORDER_REPLICATE)
    for mark in marks:
        print_mark(image, light, mark, camera, inked - ground, settings.blur)
    del light

    sensor = Sensor(settings.full_well, settings.read_noise, settings.gamma)
    grey = np.empty(image.shape, np.uint8)
    for top in range(0, settings.height, _STRIP):
        strip = slice(top, top + _STRIP)
        grey[strip] = sensor.grey_values(image[strip], noise)
    targets = sorted(targets, key=lambda target: target.id)
    return Rendering(grey, tuple(targets), camera.intrinsics, settings)


def _coded_targets(
    settings: SceneSettings, camera: Camera, generator: np.random.Generator
) -> tuple[list[Mark], list[Target], Places]:
    """Return targets with places, sizes, codes and directions drawn at random.

    The prints are larger where the wall is further away, so that every dot is about
    `dot_radius` in the image. Codes repeat only where there are more targets than codes.
    """
    design = _square_design if settings.family in SQUARE_NAMES else _ring_design
    every, printed = design(settings)
    count = settings.targets
    semi_major = settings.dot_radius * (
        1 + settings.radius_spread * generator.uniform(-1, 1, count)
    )
    turns = generator.uniform(0, 2 * math.pi, count)
    rounds = -(-count // len(every))
    shuffled = [generator.permutation(every) for _ in range(rounds)]
    numbers = np.concatenate([np.empty(0, int), *shuffled])[:count].tolist()
    reach = quiet_radius(semi_major, float(camera.intrinsics[0, 0]))
    places = grid_places(camera, reach, generator)

    marks, targets = [], []
    for number, pixel, size, turn in zip(numbers, places.centres, semi_major, turns, strict=True):
        design_of = printed(number, turn)
        mark = _mark(camera, pixel, size, design_of.reach, design_of.cover)
        x, y = camera.project(mark.centre[None])[0].tolist()
        ellipse = camera.circle(mark.centre, design_of.radius * mark.radius)
        marks.append(mark)
        targets.append(Target(number, design_of.code, x, y, *ellipse))
    return marks, targets, places


@dataclass(frozen=True, slots=True)
class _Design:
    """A target as it is printed, in units of the radius of a dot."""

    code: int
    cover: Cover
    reach: float  # of the ink
    radius: float  # of the circle that is reported as its ellipse


_Designs = tuple[np.ndarray, Callable[[int, float], _Design]]
"""The IDs that there are, and what is printed of one that is turned by an angle, rad."""


def _ring_design(settings: SceneSettings) -> _Designs:
    table = family(settings.family)

    def printed(number: int, turn: float) -> _Design:
        word = table.word(number)
        cover = ring_cover(table, word, turn, settings.pinhole)
        return _Design(word, cover, table.band_outer, 1.0)

    return np.arange(1, table.words.size + 1), printed


def _square_design(settings: SceneSettings) -> _Designs:
    def printed(number: int, turn: float) -> _Design:
        cover = square_cover(settings.family, number, _HALF_SIDE, turn)
        return _Design(number, cover, _HALF_SIDE * 2**0.5, _HALF_SIDE)

    return np.arange(len(dictionary(settings.family).bytesList)), printed


def _distractors(
    settings: SceneSettings, camera: Camera, taken: Places, generator: np.random.Generator
) -> list[Mark]:
    """Return marks that are no coded targets, clear of the targets."""
    drawn = [distractor_cover(generator) for _ in range(settings.distractors)]
    radii = np.array([radius for _, radius in drawn]) * settings.dot_radius
    places = scattered_places(camera, radii, taken, generator)
    return [
        _mark(camera, pixel, radius, 1.0, cover)
        for pixel, radius, (cover, _) in zip(places.centres, radii, drawn, strict=True)
    ]


def _mark(camera: Camera, pixel: np.ndarray, radius: float, reach: float, cover: Cover) -> Mark:
    """Return a mark at a pixel, so large that a circle of its radius is seen `radius` px wide."""
    centre = camera.wall(pixel[None])[0]
    enlargement = np.linalg.norm(camera.jacobian(centre), ord=2)
    return Mark(centre, float(radius / enlargement), reach, cover)
