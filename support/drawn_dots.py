"""Dots drawn on paper, and light on them."""

import cv2
import numpy as np


def drawn(
    dots: list[tuple[float, ...]],
    paper: int = 200,
    ink: int = 30,
    shape: tuple[int, int] = (240, 320),
) -> np.ndarray:
    """Return an image, uint8, of dots that are blurred as by a lens.

    Of each, the centre and the radius are given, px, or the centre, both semi-axes and the
    direction of the major one, rad.
    """
    image = np.full((4 * shape[0], 4 * shape[1]), paper, np.uint8)
    for x, y, major, *others in dots:
        minor, angle = others or (major, 0.0)
        centre = (round(16 * (4 * x + 1.5)), round(16 * (4 * y + 1.5)))
        axes = (round(64 * major), round(64 * minor))
        cv2.ellipse(image, centre, axes, np.degrees(angle), 0, 360, ink, -1, cv2.LINE_AA, 4)
    small = cv2.resize(image, shape[::-1], interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 0.7)


def in_stripes(image: np.ndarray, period: int, shadow: float) -> np.ndarray:
    """Return an image; every other half period lies in the shadow."""
    lit = np.arange(image.shape[1]) % period < period / 2
    return np.rint(image * np.where(lit, 1, shadow)).astype(np.uint8)
