"""Black that is darker than ink, as a camera or an editor makes it.

Ink reflects a few hundredths of the light that paper does. Where an image shows it darker, because
contrast was raised, black was clipped or the image was never photographed, the logarithm
exaggerates the dark end of every blurred edge, and marks look wider or narrower than they are.
Lifting black to what prints have undoes that.
"""

from __future__ import annotations

import numpy as np

_PRINTED = 0.25  # ratio of the gray values of ink and paper to which black is lifted


def black_lift(contrast: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Return the gray values that black is lifted to, float64, of the shape of both arrays.

    `contrast` is the ratio of the gray values of ink and paper, from 0.2 of which on black stays
    as it is, and `bright` the gray value of paper.

    Examples
    --------
    >>> black_lift(np.array([0.0, 0.3]), np.array([200.0, 200.0])).round()
    array([53.,  0.])
    """
    wanted = _PRINTED * (1 - contrast)
    missing = np.maximum(wanted - contrast, 0) * bright
    return missing / (1 - wanted + missing / 255)


def lifted(values: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """Return gray values, 0 to 255, in a range that begins at `lift` instead of at 0.

    `lift` is broadcast to the shape of `values`, see `black_lift`.
    """
    return lift + (1 - lift / 255) * values
