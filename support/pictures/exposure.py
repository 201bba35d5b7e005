"""How sheets of targets are photographed: what lies before them, reflections, light and noise."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ahf_ros.scenes.camera import Sensor

WHITE, INK = 220.0, 0.06
"""Gray value of the paper, and the reflectance of ink as a share of that of the paper."""

GAMMA = 2.2
"""Of the camera: a gray value is light to the power of 1 / GAMMA."""

_BLUR = 0.7  # of the lens, px
_TEXTURE = 0.02  # unevenness of paper, standard deviation as a share
_GRAIN = 3  # px, of the paper


class Cell(NamedTuple):
    """The samples of one cell, in the plane of its mark.

    Attributes
    ----------
    x, y : ndarray of float32, shape (n, n)
        Distance from the centre of the mark, dot radii; y is up.
    turn : float
        Direction in which the first sector starts, rad counter-clockwise.
    bits : int
        Number of sectors.
    inner, outer : float
        Radii of the band, dot radii.
    width : float
        Width of an anti-aliased edge, dot radii.
    """

    x: np.ndarray
    y: np.ndarray
    turn: float
    bits: int
    inner: float
    outer: float
    width: float


Covered = tuple[np.ndarray, np.ndarray | float]
"""The share of each sample that an object covers, and the gray value of the object."""

Occluder = Callable[[Cell, np.random.Generator], Covered]
"""An object before a mark."""

Glare = Callable[[Cell, np.random.Generator], np.ndarray]
"""Gray values that a reflection adds to each sample."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """How a sheet is photographed.

    Attributes
    ----------
    occluder : Occluder or None
        The object before each mark.
    glare : Glare or None
        The reflection on each mark.
    light : float
        Multiple of the usual exposure.
    levels : tuple of 3 float or None
        Gray values of paper and ink and the standard deviation of the noise, instead of those
        of the camera.
    develop : callable or None
        Changes the finished image, ndarray of uint8.
    """

    occluder: Occluder | None = None
    glare: Glare | None = None
    light: float = 1.0
    levels: tuple[float, float, float] | None = None
    develop: Callable[[np.ndarray, np.random.Generator], np.ndarray] | None = None

    def photograph(
        self, share: np.ndarray, glare: np.ndarray, generator: np.random.Generator
    ) -> np.ndarray:
        """Return the photograph of what lies before the camera.

        Parameters
        ----------
        share : ndarray of float32, shape (height, width)
            Light that is reflected, as a share of that of the paper; changed in place.
        glare : ndarray of float32, shape (height, width)
            Gray values that reflections add.
        generator : numpy.random.Generator
            Draws the unevenness of the paper and the noise.

        Returns
        -------
        ndarray of uint8, shape (height, width)
        """
        share *= _paper(share.shape, generator)
        share = cv2.GaussianBlur(share, (0, 0), _BLUR, borderType=cv2.BORDER_REPLICATE)
        image = self._gray_values(share, glare, generator)
        return self.develop(image, generator) if self.develop else image

    def _gray_values(
        self, share: np.ndarray, glare: np.ndarray, generator: np.random.Generator
    ) -> np.ndarray:
        if self.levels:
            white, dark, noise = self.levels
            share = (share - INK) / (1 - INK) * (white - dark) + dark
            share += generator.standard_normal(share.shape, np.float32) * np.float32(noise)
            return np.rint(np.clip(share, 0, 255)).astype(np.uint8)
        light = share * np.float32((WHITE / 255) ** GAMMA * self.light)
        if self.glare:
            gray = np.clip(cv2.pow(light, 1 / GAMMA) * 255 + glare, 0, None)
            light = cv2.pow(gray / np.float32(255), GAMMA)
        return Sensor(10000.0, 4.0, GAMMA).grey_values(light, generator)


def _paper(shape: tuple[int, int], generator: np.random.Generator) -> np.ndarray:
    """Return the unevenness of the paper and of the light on it, factors about 1."""
    coarse = generator.standard_normal([-(-side // _GRAIN) for side in shape], np.float32)
    grain = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC) * np.float32(_TEXTURE)
    direction = generator.uniform(0, 2 * math.pi)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    slope = columns / shape[1] * math.cos(direction) + rows / shape[0] * math.sin(direction)
    return (1 + grain + 0.1 * (slope - slope.mean())).astype(np.float32)
