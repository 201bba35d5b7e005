"""The edge shift of an image, from its targets, and what it means.

Dark areas are larger than in the print if ink has spread, and smaller if there was too much light.
All families report the same: what has grown in light, where gray values are taken to be light to
the power of 1 / `ahf_ros.vision.image.GAMMA`. A linear camera seems to show more ink by up to two
thirds of the standard deviation of its blur. Edges of wide marks do not show whether gray values
have a gamma.
"""

from collections.abc import Iterable

from ahf_ros.base.target import UNDECODED, Target

NOTABLE_EDGE_SHIFTS = -0.5, 0.8
"""Edge shifts from which on an image is remarked on, px: too bright, and too dark.

The latter is more than a sharp linear camera seems to show.
"""


def median_edge_shift(targets: Iterable[Target]) -> float | None:
    """Return the median edge shift of decoded targets, px; None if it was measured at none.

    Examples
    --------
    >>> seen = [Target(7, 19, 10.5, 20.0, 8.0, 7.5, edge_shift=it) for it in (-0.5, -0.7, 2.0)]
    >>> median_edge_shift(seen)
    -0.5
    """
    shifts = [
        target.edge_shift
        for target in targets
        if target.id != UNDECODED and target.edge_shift is not None
    ]
    if not shifts:
        return None
    import numpy as np  # as in `ahf_ros.base.target`

    return float(np.median(shifts))


def edge_shift_remark(shift: float | None) -> str:
    """Return what a notable edge shift of an image means; empty if it is small or unknown.

    Examples
    --------
    >>> edge_shift_remark(-0.62)
    'edges are 0.6 px too bright: the photograph is over-exposed'
    """
    bright, dark = NOTABLE_EDGE_SHIFTS
    if shift is None or bright < shift < dark:
        return ''
    if shift < 0:
        return f'edges are {-shift:.1f} px too bright: the photograph is over-exposed'
    return f'edges are {shift:.1f} px too dark: ink gain, under-exposure or a linear camera'
