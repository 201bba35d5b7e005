"""Frames of rings of dots, from the edges of disc and border.

Circles of three radii separate the image of the physical centre from the centres of ellipses.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.circles import Circles
from ahf_ros.features.frame import mean_radii
from ahf_ros.features.soft_edges import fit_circles_of_any_blur

_RAYS = 40  # round each circle
_REACH = 0.3  # how far from a circle its edge is looked for, radii of the disc: half the border
_MINIMUM_REACH = 1.35  # the same of small discs, px: what a profile needs


def fit_targets(
    gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray, code: DotFamily
) -> Fit:
    """Fit the edges of disc and border.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        Of the discs, to about a pixel.
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    code : DotFamily
    """
    reach = np.maximum(_REACH, _MINIMUM_REACH / mean_radii(frames))[:, None]
    circles = target_circles(polarity, code)
    return fit_circles_of_any_blur(gray, frames, circles, reach=reach, projective=True, rounds=3)


def target_circles(polarity: np.ndarray, code: DotFamily) -> Circles:
    """Return the edges of disc and border.

    Parameters
    ----------
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    code : DotFamily
    """
    angles = 2 * np.pi * np.arange(_RAYS) / _RAYS
    radii = np.array([1.0, code.ground_radius, code.border_radius])
    signs = np.repeat([1, -1, 1], _RAYS)
    group = np.repeat([0, 1, 1], _RAYS)
    of_points = polarity[:, None] * signs
    return Circles(np.tile(angles, 3), np.repeat(radii, _RAYS), group, of_points)
