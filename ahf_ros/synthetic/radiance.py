"""Light that a white wall sends to a camera: projected and ambient, on uneven paper."""

from __future__ import annotations

import math

import cv2
import numpy as np

from ahf_ros.synthetic.camera import Camera
from ahf_ros.synthetic.patterns import Pattern
from ahf_ros.synthetic.projector import Projector

_STRIP = 128  # rows computed at a time, which stay in the cache of a core
_FIELD_STEP = 16  # px between the samples of smooth light
_GRAINS = (0.2, 1.6, 12.8)  # of the paper, radii of a dot: finer, as large, and coarser than it
_MAXIMUM_GRAIN = 256  # px, so that the noise also varies in small images


def wall_radiance(
    camera: Camera,
    projector: Projector,
    pattern: Pattern,
    ambient: float,
    average: float,
    highest: float,
    generator: np.random.Generator,
) -> np.ndarray:
    """Return the light that a white wall sends to each pixel.

    Parameters
    ----------
    camera : Camera
        Camera that sees the wall.
    projector : Projector
        Projector that lights it.
    pattern : Pattern
        Projected pattern, defocus included.
    ambient : float
        Ambient light as a fraction of the projector's light, both at the wall's origin.
    average, highest : float
        The exposure: the mean light of a fully lit wall is `average`, or less if its brightest
        point would exceed `highest`.
    generator : numpy.random.Generator
        Draws the direction of the ambient light.

    Returns
    -------
    ndarray of float32, shape (height, width)
        Light at each pixel; 1 saturates the sensor.
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
    """Return the unevenness of the paper: noise of several grain sizes.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    deviation : float
        Standard deviation of the reflectance, as a fraction of its mean.
    dot_radius : float
        Radius of the dots in the image, px. Grain sizes are proportional to it.
    generator : numpy.random.Generator
        Draws the noise.

    Returns
    -------
    ndarray of float32
        Factors of the reflectance, around 1.
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
