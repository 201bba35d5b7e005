"""Images of a wall of ring targets, with exact truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.codes.ring import FAMILY_NAMES, Family, family
from ahf_ros.parameter import check_parameters, parameter
from ahf_ros.synthetic.camera import Camera, Sensor, tilted_camera
from ahf_ros.synthetic.lights import LIGHT_NAMES, Projector, light_pattern, rig_projector
from ahf_ros.synthetic.prints import Print, apply_ink, ink
from ahf_ros.target import Target

_QUIET_ZONE = 4.2  # free radius of a target, in radii of the dot
_CLEARANCE = 1.05  # perspective over one target
_STEEPEST_VIEW = math.radians(75)
_STRIP = 128  # rows of light computed at a time
_FIELD_STEP = 16  # px between the samples of smooth light


@dataclass(frozen=True, slots=True)
class SceneSettings:
    """What is on the wall, how it is lit and how it is photographed."""

    width: int = parameter(3984, 'Width of the image, px.', minimum=16, maximum=20000)
    height: int = parameter(2656, 'Height of the image, px.', minimum=16, maximum=20000)
    targets: int = parameter(54, 'Number of coded targets in the image.', minimum=0)
    family: str = parameter('metashape12', 'Family of the codes.', choices=FAMILY_NAMES)
    polarity: str = parameter(
        'dark', 'Dark targets on white, or bright ones on black.', choices=('dark', 'bright')
    )
    dot_radius: float = parameter(
        20.0, 'Semi-major axis of the middle dot in the image, px.', minimum=1.0, maximum=500.0
    )
    radius_spread: float = parameter(
        0.1, 'Largest deviation of a radius, as a share of it.', minimum=0.0, maximum=0.5
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
        0.5, 'Blur of the projector, standard deviation in projector px.', minimum=0.0, maximum=20.0
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
    exposure: float = parameter(
        220.0, 'Grey value of lit white.', minimum=1.0, maximum=255.0
    )
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
        """Check each parameter and that the wall is in view and holds the targets.

        Raises
        ------
        ValueError
            Naming the field, its value and what is accepted.
        """
        check_parameters(self)
        half_view = math.hypot(self.width, self.height) / 2 / (self.width * self.focal_length)
        steepest = math.degrees(math.atan(0.95 / (half_view + 0.01)))
        if self.tilt > steepest:
            raise ValueError(
                f'tilt is {self.tilt!r}, accepted is a number from 0 to {steepest:.1f} with a '
                f'focal_length of {self.focal_length:g}'
            )
        columns, rows = _most_cells(self)
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
        K of the camera.
    settings : SceneSettings
        What was rendered.
    """

    image: np.ndarray
    targets: tuple[Target, ...]
    intrinsics: np.ndarray
    settings: SceneSettings


def render(settings: SceneSettings) -> Rendering:
    """Return the photograph of a scene; the same settings always give the same image.

    Light is smooth on the scale of a pixel, prints are not: the light is computed once a pixel,
    and its product with the prints is supersampled, blurred by the lens and averaged over each
    pixel.

    Raises
    ------
    ValueError
        If the targets that are wanted do not fit into the part of the wall that is seen at
        less than 75 degrees.
    """
    setup, wall, lamp, noise = np.random.default_rng(settings.seed).spawn(4)
    table = family(settings.family)
    camera = tilted_camera(
        settings.width,
        settings.height,
        settings.focal_length * settings.width,
        math.radians(settings.tilt),
        settings.distortion,
        setup,
    )
    projector = rig_projector(camera.pose, settings.dot_radius / 6.4, setup)
    prints = place_targets(settings, camera, table, wall)

    light = _light_on_sensor(settings, camera, projector, lamp)
    if settings.texture:
        light *= _texture(settings, wall)
    ground, inked = (1.0, settings.black) if settings.polarity == 'dark' else (settings.black, 1.0)
    image = light * np.float32(ground)
    if settings.blur:
        image = cv2.GaussianBlur(image, (0, 0), settings.blur, borderType=cv2.BORDER_REPLICATE)
    _print_targets(image, light, prints, settings, table, camera, (ground, inked))
    del light

    sensor = Sensor(settings.full_well, settings.read_noise, settings.gamma)
    grey = np.empty(image.shape, np.uint8)
    for top in range(0, settings.height, _STRIP):
        strip = slice(top, top + _STRIP)
        grey[strip] = sensor.grey_values(image[strip], noise)
    targets = sorted((_truth(item, camera) for item in prints), key=lambda target: target.id)
    return Rendering(grey, tuple(targets), camera.intrinsics, settings)


def place_targets(
    settings: SceneSettings, camera: Camera, table: Family, generator: np.random.Generator
) -> list[Print]:
    """Return targets on the wall that appear in a grid with jitter, sizes and codes at random.

    The prints are larger where the wall is further away, so that every dot is about
    `dot_radius` in the image. Codes repeat only where there are more targets than codes.
    """
    corners, cell = _free_cells(settings, camera, generator)
    order = [generator.permutation(table.words.size) for _ in range(
        -(-settings.targets // table.words.size))]
    numbers = np.concatenate(order)[: settings.targets] + 1 if order else ()
    spread = 1 + generator.uniform(-1, 1, settings.targets) * settings.radius_spread
    turns = generator.uniform(0, 2 * math.pi, settings.targets)
    places = generator.uniform(0, 1, (settings.targets, 2))

    prints = []
    for corner, number, share, turn, place in zip(corners, numbers, spread, turns, places):
        semi_major = settings.dot_radius * share
        reach = semi_major * _QUIET_ZONE * _CLEARANCE
        pixel = corner + reach + place * (cell - 2 * reach) - 0.5
        centre = camera.wall(pixel[None])[0]
        radius = semi_major / np.linalg.norm(camera.jacobian(centre), ord=2)
        word = table.word(int(number))
        prints.append(Print(int(number), word, centre, float(radius), float(turn)))
    return prints


def _footprint(settings: SceneSettings) -> float:
    """Return the side of the square that the largest target needs, px."""
    largest = settings.dot_radius * (1 + settings.radius_spread)
    return 2 * largest * _QUIET_ZONE * _CLEARANCE


def _most_cells(settings: SceneSettings) -> tuple[int, int]:
    """Return the columns and rows of the finest grid whose cells hold a target."""
    footprint = _footprint(settings)
    return int(settings.width / footprint), int(settings.height / footprint)


def _free_cells(
    settings: SceneSettings, camera: Camera, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the upper left corners of cells, one a target, and the size of a cell, px."""
    most_columns, most_rows = _most_cells(settings)
    size = np.array([settings.width, settings.height], dtype=float)
    cells = np.empty((0, 2))
    cell = size
    ratio = settings.width / settings.height
    for count in range(settings.targets, most_columns * most_rows + 1):
        columns = min(max(round(math.sqrt(count * ratio)), 1), most_columns)
        rows = min(-(-count // columns), most_rows)
        columns = min(-(-count // rows), most_columns)
        if columns * rows < settings.targets:
            continue
        cell = size / (columns, rows)
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        cells = np.stack((x.ravel(), y.ravel()), axis=1) * cell
        cells = cells[camera.view_angle(camera.wall(cells + cell / 2)) < _STEEPEST_VIEW]
        if len(cells) >= settings.targets:
            chosen = generator.permutation(len(cells))[: settings.targets]
            return cells[chosen], cell
    raise ValueError(
        f'targets is {settings.targets!r}, accepted is an integer from 0 to {len(cells)} at a '
        f'tilt of {settings.tilt:g}'
    )


def _truth(printed: Print, camera: Camera) -> Target:
    """Return the exact record of a printed target."""
    x, y = camera.project(printed.centre[None])[0]
    semi_major, semi_minor, angle = camera.circle(printed.centre, printed.radius)
    return Target(printed.number, printed.word, float(x), float(y), semi_major, semi_minor, angle)


def _print_targets(
    image: np.ndarray,
    light: np.ndarray,
    prints: list[Print],
    settings: SceneSettings,
    table: Family,
    camera: Camera,
    reflectances: tuple[float, float],
) -> None:
    """Put the prints into the image, each with what the lens blurs over its surroundings."""
    margin = 2 + 4 * settings.blur
    for printed in prints:
        marks = ink(printed, table, settings.pinhole, camera, margin)
        block = marks.rows, marks.columns
        image[block] = apply_ink(light[block], marks, *reflectances, settings.blur)


def _light_on_sensor(
    settings: SceneSettings,
    camera: Camera,
    projector: Projector,
    generator: np.random.Generator,
) -> np.ndarray:
    """Return the light that white would send to each pixel, as a share of saturation."""
    pattern = light_pattern(settings.light, settings.defocus, generator)
    lit, ambient = _smooth_light(settings, camera, projector, generator)
    to_projector = np.diag((projector.scale, projector.scale, 1.0)) @ projector.pose
    to_projector = to_projector @ np.linalg.inv(camera.pose)
    columns = np.arange(settings.width, dtype=float)[None, :]
    light = lit
    for top in range(0, settings.height, _STRIP):
        rows = np.arange(top, min(top + _STRIP, settings.height), dtype=float)[:, None]
        x, y = (ray.astype(np.float32) for ray in camera.rays(columns, rows))
        u, v, depth = (row[0] * x + (row[1] * y + row[2]) for row in np.float32(to_projector))
        np.reciprocal(depth, out=depth)
        strip = slice(top, top + len(rows))
        light[strip] *= pattern(u * depth, v * depth)
        light[strip] += ambient[strip]
    return light


def _smooth_light(
    settings: SceneSettings,
    camera: Camera,
    projector: Projector,
    generator: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the light of a pattern that is 1, and of the surroundings, shape of the image each.

    White in full light has the grey value `exposure` on average, and nowhere more than midway
    from there to saturation.
    """
    columns, rows = (
        (np.arange(-(-size // _FIELD_STEP) + 2) - 0.5) * _FIELD_STEP - 0.5
        for size in (settings.width, settings.height)
    )
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    x, y = camera.wall(grid).T
    seen_x, seen_y = camera.rays(grid[:, 0], grid[:, 1])
    vignetting = (1 + seen_x**2 + seen_y**2) ** -2
    lit = projector.irradiance(x, y) * vignetting
    direction = generator.uniform(0, 2 * math.pi)
    slope = (x * math.cos(direction) + y * math.sin(direction)) / settings.width
    ambient = settings.ambient * (1 + 0.2 * np.tanh(slope)) * vignetting

    white = lit + ambient
    levels = np.array([settings.exposure, (settings.exposure + 255) / 2]) / 255
    average, highest = levels**settings.gamma
    scale = min(average / white.mean(), highest / white.max())
    return tuple(
        _enlarge(np.float32(field * scale).reshape(len(rows), len(columns)), _FIELD_STEP, settings)
        for field in (lit, ambient)
    )


def _texture(settings: SceneSettings, generator: np.random.Generator) -> np.ndarray:
    """Return the unevenness of the wall as factors about 1: noise of several scales."""
    factors = np.ones((settings.height, settings.width), np.float32)
    scales = (4, 32, 256)
    for scale in scales:
        shape = (-(-settings.height // scale) + 2, -(-settings.width // scale) + 2)
        noise = generator.standard_normal(shape, dtype=np.float32)
        factors += _enlarge(noise * np.float32(settings.texture / len(scales) ** 0.5), scale, settings)
    return np.clip(factors, 0.2, 1.8, out=factors)


def _enlarge(samples: np.ndarray, step: int, settings: SceneSettings) -> np.ndarray:
    """Return samples that are `step` px apart, from half a step outside, at every pixel."""
    rows, columns = samples.shape
    whole = cv2.resize(samples, (columns * step, rows * step), interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(
        whole[step : step + settings.height, step : step + settings.width]
    )
