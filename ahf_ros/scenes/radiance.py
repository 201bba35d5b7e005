"""Light that a white wall sends to a camera: of a projector and ambient, on uneven paper."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.scenes.camera import Camera
from ahf_ros.scenes.patterns import Pattern

_STRIP = 128  # rows computed at a time, which stay in the cache of a core
_FIELD_STEP = 16  # px between the samples of smooth light
_GRAINS = (0.2, 1.6, 12.8)  # of the paper, radii of a dot: finer, as large, and coarser than it
_MAXIMUM_GRAIN = 256  # px, so that the noise also varies in small images


@dataclass(frozen=True, slots=True, eq=False)
class Projector:
    """A projector beside the camera that lights the same part of the wall."""

    pose: np.ndarray  # homography from the wall (x, y, 1) to rays (x, y, 1)
    position: np.ndarray  # in the coordinates of the wall, shape (3,)
    scale: float  # focal length, projector px; projector pixel (0, 0) is the principal point

    @property
    def homography(self) -> np.ndarray:
        """Homography from the wall (x, y, 1) to projector pixels."""
        return np.diag((self.scale, self.scale, 1.0)) @ self.pose

    def irradiance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the light of a white pattern on points of the wall, 1 at its origin.

        It follows the inverse square of the distance, the cosine of the angle of incidence, and
        the fourth power of the cosine of the projector's field angle.
        """
        towards = np.stack((x - self.position[0], y - self.position[1]), axis=-1)
        squared = (towards**2).sum(axis=-1) + self.position[2] ** 2
        reach = self.position @ self.position
        field = (self.position[2] ** 2 - towards @ self.position[:2]) / np.sqrt(squared * reach)
        return (reach / squared) ** 1.5 * np.clip(field, 0, 1) ** 4


def rig_projector(
    camera_pose: np.ndarray, pixel: float, generator: np.random.Generator
) -> Projector:
    """Return a projector 12 to 20 degrees beside the camera, aimed at the wall's origin.

    It is displaced along the axis of the wall's tilt, so that projector and camera see the wall
    at similar angles, and rotated about its optical axis by up to 8 degrees. The camera's optical
    axis meets the origin of the wall, where a projector pixel has the size `pixel`, in units of
    the wall.
    """
    aside = generator.uniform(math.radians(12), math.radians(20)) * generator.choice((-1, 1))
    turn = generator.uniform(-math.radians(8), math.radians(8))
    nearness = generator.uniform(0.85, 1.1)
    rotation = np.column_stack(
        (camera_pose[:, :2], np.cross(camera_pose[:, 0], camera_pose[:, 1]))
    )
    tilted = np.hypot(*rotation[:2, 2])
    free = generator.uniform(0, 2 * math.pi)
    across = rotation[:2, 2] / tilted if tilted > 1e-6 else (math.cos(free), math.sin(free))
    swing, _ = cv2.Rodrigues(np.array([*across, 0.0]) * aside)
    roll, _ = cv2.Rodrigues(np.array([0.0, 0.0, turn]))
    orientation = roll @ swing @ rotation
    distance = camera_pose[2, 2] * nearness
    pose = np.column_stack((orientation[:, :2], (0.0, 0.0, distance)))
    return Projector(pose, -orientation.T @ (0.0, 0.0, distance), distance / pixel)


def wall_radiance(
    camera: Camera,
    projector: Projector,
    pattern: Pattern,
    ambient: float,
    average: float,
    highest: float,
    generator: np.random.Generator,
) -> np.ndarray:
    """Return the light that a white wall sends to each pixel, float32; 1 saturates the sensor.

    Ambient light, of a random direction, is a fraction of the projector's light, both at the
    wall's origin. The exposure is such that the mean light of a fully lit wall is `average`, or
    less if its brightest point would exceed `highest`.
    """
    lit, surrounding = _smooth_light(camera, projector, ambient, generator)
    white = lit + surrounding
    scale = min(average / white.mean(), highest / white.max())
    shape = camera.height, camera.width
    light = _enlarge((lit * scale).astype(np.float32), _FIELD_STEP, shape)
    floor = _enlarge((surrounding * scale).astype(np.float32), _FIELD_STEP, shape)

    to_projector = (projector.homography @ np.linalg.inv(camera.pose)).astype(np.float32)
    columns = np.arange(camera.width, dtype=float)[None, :]
    for top in range(0, camera.height, _STRIP):
        rows = np.arange(top, min(top + _STRIP, camera.height), dtype=float)[:, None]
        x, y = (ray.astype(np.float32) for ray in camera.rays(columns, rows))
        u, v, depth = (row[0] * x + (row[1] * y + row[2]) for row in to_projector)
        np.reciprocal(depth, out=depth)
        strip = slice(top, top + len(rows))
        light[strip] *= pattern(u * depth, v * depth)
        light[strip] += floor[strip]
    return light


def paper_texture(
    shape: tuple[int, int], deviation: float, dot_radius: float, generator: np.random.Generator
) -> np.ndarray:
    """Return factors of the reflectance of uneven paper: noise of several grain sizes.

    Their mean is 1. Grain sizes are proportional to the radius of the dots in the image, px.
    """
    factors = np.ones(shape, np.float32)
    each = np.float32(deviation / math.sqrt(len(_GRAINS)))
    for grain in _GRAINS:
        step = min(max(round(grain * dot_radius), 1), _MAXIMUM_GRAIN)
        samples = (-(-shape[0] // step) + 2, -(-shape[1] // step) + 2)
        noise = generator.standard_normal(samples, dtype=np.float32) * each
        factors += _enlarge(noise, step, shape)
    return np.clip(factors, 0.2, 1.8, out=factors)


def _smooth_light(
    camera: Camera, projector: Projector, ambient: float, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return the light of a white pattern, and ambient light, every `_FIELD_STEP` px."""
    columns, rows = (
        (np.arange(-(-size // _FIELD_STEP) + 2) - 0.5) * _FIELD_STEP - 0.5
        for size in (camera.width, camera.height)
    )
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    x, y = camera.wall(grid).T
    vignetting = camera.vignetting(grid)
    lit = projector.irradiance(x, y) * vignetting
    direction = generator.uniform(0, 2 * math.pi)
    slope = (x * math.cos(direction) + y * math.sin(direction)) / camera.width
    surrounding = ambient * (1 + 0.2 * np.tanh(slope)) * vignetting
    shape = len(rows), len(columns)
    return lit.reshape(shape), surrounding.reshape(shape)


def _enlarge(samples: np.ndarray, step: int, shape: tuple[int, int]) -> np.ndarray:
    """Interpolate samples `step` px apart, the first half a step outside, at every pixel."""
    rows, columns = samples.shape
    whole = cv2.resize(samples, (columns * step, rows * step), interpolation=cv2.INTER_CUBIC)
    return whole[step : step + shape[0], step : step + shape[1]]
