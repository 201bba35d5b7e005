"""The edge shift of an image, from its targets, and what it means.

Dark areas are larger than in the print where ink has spread, and smaller where there was too much
light or the image is blurred.
"""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median

from ahf_ros.target import UNDECODED, Target

NOTABLE_EDGE_SHIFT = 0.5
"""Edge shift from which on an image is remarked on, px.

The gamma of a camera alone makes edges 0.4 px too bright in a sharp image: up to half of the
standard deviation of its blur.
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
    return median(shifts) if shifts else None


def edge_shift_remark(shift: float | None) -> str:
    """Return what a notable edge shift of an image means; empty if it is small or unknown.

    Examples
    --------
    >>> edge_shift_remark(-0.62)
    'edges are 0.6 px too bright: the photograph is over-exposed or blurred'
    """
    if shift is None or abs(shift) < NOTABLE_EDGE_SHIFT:
        return ''
    if shift < 0:
        return f'edges are {-shift:.1f} px too bright: the photograph is over-exposed or blurred'
    return f'edges are {shift:.1f} px too dark: ink gain or under-exposure'
