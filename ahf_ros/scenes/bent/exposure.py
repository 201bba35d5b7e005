"""What a camera makes of light: blur, vignetting, noise, and the curve of sRGB."""

import math

import cv2
import numpy as np

_FINE = 5  # samples along each axis of a cell of the kernel
_GAUSSIAN = 4.0  # standard deviations that a Gaussian reaches


def spread(
    blur: float, confusion: float, motion: float, direction: float, scale: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the point spread of a lens out of focus that moves, as two kernels to apply in turn.

    Parameters
    ----------
    blur : float
        Of the lens, standard deviation, px.
    confusion : float
        Radius of the disc that a point out of focus becomes, px.
    motion, direction : float
        Length of the path of the image, px, and its direction, rad from +x towards +y.
    scale : int
        Samples per pixel of the image that the kernels are for.

    Returns
    -------
    shape : ndarray of float32, shape (n, n)
        The disc along the path.
    gaussian : ndarray of float32, shape (m,)
        Along each axis.
    """
    confusion, motion = max(confusion, 0.5 / scale), max(motion, 0.1 / scale)
    reach = math.ceil((confusion + motion / 2) * scale)
    cells = (np.arange((2 * reach + 1) * _FINE) + 0.5) / _FINE - reach - 0.5
    x, y = np.meshgrid(cells / scale, cells / scale)
    along = x * math.cos(direction) + y * math.sin(direction)
    across = y * math.cos(direction) - x * math.sin(direction)
    # the length of the path from which the disc reaches a point
    chord = np.sqrt(np.maximum(confusion**2 - across**2, 0))
    ends = np.minimum(along + chord, motion / 2) - np.maximum(along - chord, -motion / 2)
    path = np.maximum(ends, 0).reshape(2 * reach + 1, _FINE, 2 * reach + 1, _FINE)
    shape = path.sum(axis=(1, 3))
    shape += shape[::-1, ::-1]  # last bits move no centre
    side = math.ceil(_GAUSSIAN * blur * scale)
    gaussian = cv2.getGaussianKernel(2 * side + 1, blur * scale, cv2.CV_32F)
    if not blur:
        gaussian = np.ones((1, 1), np.float32)
    return (shape / shape.sum()).astype(np.float32), gaussian.ravel()


def vignette(width: int, height: int, rows: np.ndarray, lost: float) -> np.ndarray:
    """Return the share of light that reaches the pixels of rows, 1 - `lost` in the corners."""
    x = np.arange(width) - (width - 1) / 2
    y = rows[:, None] - (height - 1) / 2
    corner = ((width - 1) ** 2 + (height - 1) ** 2) / 4
    share: np.ndarray = 1 - lost * (x * x + y * y) / max(corner, 1)
    return share.astype(np.float32)


def exposed(
    light: np.ndarray, full_well: float, read_noise: float, generator: np.random.Generator
) -> np.ndarray:
    """Return 8-bit grey values of light, where 1 saturates, by the curve of sRGB.

    Photoelectrons are counted: they have the distribution of Poisson. Without a full well there
    is no noise.
    """
    if full_well:
        electrons = generator.poisson(np.maximum(light, 0).astype(np.float64) * full_well)
        noise = generator.standard_normal(light.shape) * read_noise
        light = (electrons + noise) / full_well
    light = np.clip(light, 0, 1)
    curved = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.rint(curved * 255).astype(np.uint8)


def light_of_grey(grey: float) -> float:
    """Return the light that has a grey value, by the curve of sRGB, IEC 61966-2-1."""
    share = grey / 255
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4
