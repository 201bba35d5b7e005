"""Light on a surface: a projector, light from all around, and what the surface mirrors.

Highlights are of microfacets with the distribution GGX, Walter et al., Microfacet models for
refraction through rough surfaces, EGSR 2007; shadowing and the Fresnel term are Schlick's, An
inexpensive BRDF model for physically-based rendering, Eurographics 1994.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.scenes.bent.scene import facing_axes
from ahf_ros.scenes.bent.settings import BentSettings
from ahf_ros.scenes.patterns import Pattern, light_pattern, turned

_PER_DOT = 6.4  # projector pixels in the radius of a dot, as with the other maker
_ASIDE = (12.0, 20.0)  # of the projector, seen from the middle of the scene, degrees
_ROLL = 8.0  # of the projector at most, degrees
_NEARNESS = (0.85, 1.1)  # distance of the projector over the camera's
_SKY = 0.8  # length of the horizontal part of the direction that more light comes from


Vectors = np.ndarray | list[np.ndarray]
"""Components x, y and z of vectors."""


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """The lamps of a scene, in the coordinates of the camera; lengths in mm.

    Attributes
    ----------
    position : ndarray of float64, shape (3,)
        Of the projector.
    axes : ndarray of float64, shape (3, 3)
        x, y and z of the projector, in rows.
    scale : float
        Focal length of the projector, px.
    pattern : callable
        Brightness at pixels of the projector.
    reach : float
        Distance from the projector at which its light is 1.
    ambient : float
        Light from all around on a surface that faces the camera.
    brightest : ndarray of float64, shape (3,)
        Unit vector to where most of the light from all around comes from.
    """

    position: np.ndarray
    axes: np.ndarray
    scale: float
    pattern: Pattern
    reach: float
    ambient: float
    brightest: np.ndarray


def drawn_light(settings: BentSettings, generator: np.random.Generator) -> Light:
    """Return a projector beside the camera, at random, that is aimed at the scene."""
    middle = np.array([0.0, 0.0, settings.distance])
    aside = math.radians(generator.uniform(*_ASIDE))
    about = generator.uniform(0, 2 * math.pi)
    roll = math.radians(generator.uniform(-_ROLL, _ROLL))
    reach = settings.distance * generator.uniform(*_NEARNESS)
    away = np.array([math.cos(about), math.sin(about), 0.0]) * math.sin(aside)
    away[2] = -math.cos(aside)
    rolled, _ = cv2.Rodrigues(np.array([0.0, 0.0, roll]))
    pixel = settings.printed_radius / _PER_DOT
    size, turn = settings.light_scale, math.radians(settings.light_turn)
    pattern = light_pattern(settings.light, settings.defocus / size, generator)
    sky = generator.uniform(0, 2 * math.pi)
    brightest = np.array([math.cos(sky) * _SKY, math.sin(sky) * _SKY, -1.0])
    return Light(
        position=middle + away * reach,
        axes=(facing_axes(-away) @ rolled).T,
        scale=reach / pixel,
        pattern=turned(pattern, size, turn),
        reach=reach,
        ambient=settings.ambient,
        brightest=brightest / np.linalg.norm(brightest),
    )


def surface_light(
    light: Light, points: np.ndarray, normals: np.ndarray, gloss: float, roughness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the light that points on a surface send to the camera, float32.

    Parameters
    ----------
    points, normals : ndarray of float32, shape (3, ...)
        In the coordinates of the camera; normals are unit vectors on its side.
    gloss : float
        Share of light that is mirrored at normal incidence.
    roughness : float
        Square root of the width of the microfacets' slopes.

    Returns
    -------
    scattered, mirrored : ndarray of float32, shape (...)
        Light of a white surface, to be multiplied with its reflectance, and light of its gloss.
    """
    position, brightest = (it.astype(np.float32) for it in (light.position, light.brightest))
    towards = [of_lamp - own for of_lamp, own in zip(position, points, strict=True)]
    u, v, depth = (-_product(axis, towards) for axis in light.axes.astype(np.float32))
    depth = np.float32(light.scale) / depth
    lit = light.pattern(u * depth, v * depth)
    squared = _product(towards, towards)
    towards = _scaled(towards, 1 / np.sqrt(squared))
    incidence = np.maximum(_product(towards, normals), 0)
    lit *= np.float32(light.reach**2) / squared
    around = (1 + _product(brightest, normals)) * (light.ambient / (1 - brightest[2]))
    scattered = lit * incidence + around
    if not gloss:
        return scattered, np.zeros_like(scattered)

    view = _scaled(points, -1 / np.sqrt(_product(points, points)))
    facing = np.maximum(_product(view, normals), np.float32(1e-3))
    between = [own + of_lamp for own, of_lamp in zip(view, towards, strict=True)]
    between = _scaled(between, 1 / np.sqrt(_product(between, between)))
    tilt = _product(between, normals)
    width = np.float32(roughness**4)
    facets = width / (tilt * tilt * (width - 1) + 1) ** 2  # times pi, as scattered light is
    mirrored = facets * _fresnel(gloss, _product(between, view)) * lit * incidence / 4
    half = np.float32(roughness**2 / 2)
    for cosine in (incidence, facing):  # each in the numerator and the denominator of the model
        mirrored /= cosine * (1 - half) + half
    return scattered, mirrored + around * _fresnel(gloss, facing)


def _product(first: Vectors, second: Vectors) -> np.ndarray:
    """Return the scalar product of vectors."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def _scaled(vectors: Vectors, factor: np.ndarray) -> list[np.ndarray]:
    return [component * factor for component in vectors]


def _fresnel(gloss: float, cosine: np.ndarray) -> np.ndarray:
    """Return the share of light that is mirrored at an angle of incidence."""
    squared = (1 - cosine) ** 2
    share: np.ndarray = squared * squared * (1 - cosine) * np.float32(1 - gloss)
    return share + np.float32(gloss)
