"""Error ellipses, names and round numbers in figures of coordinates."""

import math
from collections.abc import Iterable

import numpy as np

from ahf_ros.network.network import FloatArray

CONFIDENCE = math.sqrt(5.991)
"""Semi-axes of the ellipse that holds 95 %, in standard deviations."""

_NAME = 16, 9  # px, that a name takes


def principal_axes(places: FloatArray, towards: FloatArray) -> FloatArray:
    """Return the directions (3, 3) right, up and to the viewer; places extend least along it.

    The viewer is on the side that `towards` (3,) points to.
    """
    axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=True)[2].copy()
    if towards @ axes[2] < 0:
        axes[2] *= -1
    if np.linalg.det(axes) < 0:  # or the views would be mirrored
        axes[1] *= -1
    return axes


def ellipse(covariance: FloatArray, axes: FloatArray) -> tuple[float, float, float]:
    """Return semi-axes of the ellipse that holds 95 % in a view along two axes (2, 3).

    The third number turns the major one for an SVG, whose y goes down, degrees.
    """
    values, vectors = np.linalg.eigh(axes @ covariance @ axes.T)
    minor, major = CONFIDENCE * np.sqrt(np.maximum(values, 0))
    return float(major), float(minor), -math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))


def apart(place: tuple[float, float], others: Iterable[tuple[float, float]]) -> bool:
    """Return whether a name at a place, px, can be read beside those at others."""
    x, y = place
    return all(abs(x - u) > _NAME[0] or abs(y - v) > _NAME[1] for u, v in others)


def round_number(number: float) -> float:
    """Return 1, 2 or 5 times a power of ten, the largest up to a number."""
    power = 10.0 ** math.floor(math.log10(number))
    return max(step * power for step in (1, 2, 5) if step * power <= number * (1 + 1e-9))
