"""White images, in which too much light may have hidden parts of targets."""

from __future__ import annotations

import numpy as np

from ahf_ros.imaging.image import SATURATED, as_gray

_MUCH_WHITE = 0.3  # share of an image


def white_remark(image: np.ndarray) -> str:
    """Return what it means that much of an image is white; empty if little is.

    Where light makes ink as white as paper, gaps or bands of targets vanish.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)

    Examples
    --------
    >>> white_remark(np.full((20, 20), 255, np.uint8)).partition(': ')
    ('100 % of the image is white', ': ', 'gaps or bands of targets may have vanished')
    """
    share = float((as_gray(image) >= SATURATED).mean())
    if share < _MUCH_WHITE:
        return ''
    return f'{100 * share:.0f} % of the image is white: gaps or bands of targets may have vanished'
