"""Growth of ink in light, from edges that were measured in gray values.

A lens and pixels blur light, and the gamma of a camera bends the blurred edge: half-way between
the gray values of ink and paper there is far less than half of the light, so that bright areas
look larger. Where a normally blurred edge has a share of the light is the normal quantile of it.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.vision.image import GAMMA
from ahf_ros.vision.normal import normal_integral

_QUANTILES = np.linspace(-3.0, 3.0, 601)  # standard deviations of the blur
_SHARES = normal_integral(_QUANTILES)  # of the light from ink to paper, there
# Variance of the blur that interpolation between gray values adds, px^2: with it, rings rendered
# with blurs from 0.4 to 2 px and inks of 0.06 and 0.2 of the light have grown by 0.00 to 0.04 px,
# and with inks of 0.02, whose edges are no longer like normally blurred ones, by 0.03 to 0.16 px.
_INTERPOLATION = 0.2


def growth_in_light(shift: np.ndarray, blur: np.ndarray, contrast: np.ndarray) -> np.ndarray:
    """Return by how much ink has grown in light on all edges, px, shape (k,).

    Parameters
    ----------
    shift : ndarray of float64, shape (k,)
        By how much it has grown in gray values, px; NaN where unknown.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px.
    contrast : ndarray of float64, shape (k,)
        Gray value of ink over that of paper.

    Examples
    --------
    >>> shift, blur, contrast = np.array([-0.32]), np.array([0.9]), np.array([0.27])
    >>> bool(abs(growth_in_light(shift, blur, contrast)[0]) < 0.02)
    True
    """
    ratio = np.clip(contrast, 0.0, 1.0 - 1e-6)
    low, middle = ratio**GAMMA, ((1 + ratio) / 2) ** GAMMA
    quantile = np.interp((middle - low) / (1 - low), _SHARES, _QUANTILES)
    growth: np.ndarray = shift - np.sqrt(np.maximum(blur**2 - _INTERPOLATION, 0)) * quantile
    return growth
