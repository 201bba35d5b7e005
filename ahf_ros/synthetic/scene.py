"""Rendered photographs of a wall of coded targets, with exact truth."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.synthetic.camera import Camera, Sensor, tilted_camera
from ahf_ros.synthetic.covers import card_cover
from ahf_ros.synthetic.designs import designs
from ahf_ros.synthetic.distractors import distractor_marks
from ahf_ros.synthetic.layout import Placements, grid_placements, quiet_radius, size_ratios
from ahf_ros.synthetic.patterns import light_pattern, turned
from ahf_ros.synthetic.prints import Mark, mark_at, print_mark
from ahf_ros.synthetic.projector import rig_projector
from ahf_ros.synthetic.radiance import paper_texture, wall_radiance
from ahf_ros.synthetic.settings import CARD_WIDTH, SceneSettings
from ahf_ros.target import Target, TrueTarget, sorted_targets

__all__ = ['Rendering', 'SceneSettings', 'render']

_PROJECTOR_PIXELS = 6.4  # per radius of a dot: 1280 across an image of 200 radii, as by default
_PIXEL_DEVIATION = 12**-0.5  # standard deviation of a position inside a pixel, px
_STRIP = 128  # rows exposed at a time, to bound the memory


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
    projector_pixel = settings.dot_radius / _PROJECTOR_PIXELS
    projector = rig_projector(camera.pose, projector_pixel, setup)
    cards, marks, targets, placements = _coded_targets(settings, camera, wall)
    distractors = distractor_marks(
        settings.distractors, settings.dot_radius, camera, placements, clutter
    )

    softness = math.hypot(settings.defocus, _PIXEL_DEVIATION / projector_pixel)
    size, turn = settings.light_scale, math.radians(settings.light_turn)
    shift = phase / settings.phases
    pattern = turned(light_pattern(settings.light, softness / size, lamp, shift), size, turn)
    average = settings.overexposure * (settings.exposure / 255) ** settings.gamma
    highest = settings.overexposure * ((settings.exposure + 255) / 2 / 255) ** settings.gamma
    light = wall_radiance(camera, projector, pattern, settings.ambient, average, highest, lamp)
    if settings.texture:
        light *= paper_texture(light.shape, settings.texture, settings.dot_radius, wall)
    ground, inked = (1.0, settings.black) if settings.polarity == 'dark' else (settings.black, 1.0)
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
    the image. Codes repeat only if there are more targets than codes.
    """
    every, design_of = designs(settings.family, settings.pinhole, settings.family_file)
    count = settings.targets
    semi_major = settings.dot_radius * (
        1 + settings.radius_spread * generator.uniform(-1, 1, count)
    )
    semi_major *= np.resize(size_ratios(settings.sizes), count)
    turns = generator.uniform(0, 2 * math.pi, count)
    rounds = -(-count // len(every))
    shuffled = [generator.permutation(every) for _ in range(rounds)]
    ids = np.concatenate([np.empty(0, int), *shuffled])[:count].tolist()
    free = settings.free_radius
    reach = quiet_radius(semi_major, float(camera.intrinsics[0, 0]), free)
    placements = grid_placements(camera, reach, generator)
    gain = settings.edge_shift if settings.polarity == 'dark' else -settings.edge_shift

    cards, marks, targets = [], [], []
    for number, pixel, size, turn in zip(ids, placements.centres, semi_major, turns, strict=True):
        design = design_of(number, turn, gain / size)
        mark = mark_at(camera, pixel, size, design.reach, design.cover)
        x, y = camera.project(mark.centre[None])[0].tolist()
        ellipse = camera.circle(mark.centre, design.radius * mark.radius)
        marks.append(mark)
        if settings.wall < 1:
            card = card_cover(free * CARD_WIDTH, turn)
            cards.append(Mark(mark.centre, mark.radius, free, card))
        targets.append(Target(number, design.code, x, y, *ellipse, family=settings.family))
    return cards, marks, targets, placements
