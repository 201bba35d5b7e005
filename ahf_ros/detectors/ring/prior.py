"""What is known of the targets of an image before one of them is read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.robust import NORMAL

_USUAL = 1.0  # deviation of the shift of edges of images, px
_LEAST = 0.3  # of those of the targets of one image, which are not lit and printed alike
_FEWEST = 3  # certain targets that tell the shift of an image


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known before a target is read.

    Attributes
    ----------
    expected : frozenset of int
        IDs that are likely to be there. Empty: all IDs are equally likely.
    shift, deviation : float
        By how much what is dark has probably grown on all edges, and its standard deviation, px.
    """

    expected: frozenset[int] = frozenset()
    shift: float = 0.0
    deviation: float = _USUAL

    @staticmethod
    def after(expected: frozenset[int], shifts: np.ndarray) -> Prior:
        """Return what is known once certain targets show shifts of edges, shape (k,), px."""
        if len(shifts) < _FEWEST:
            return Prior(expected)
        shift = float(np.median(shifts))
        spread = NORMAL * float(np.median(np.abs(shifts - shift)))
        return Prior(expected, shift, float(np.clip(spread, _LEAST, _USUAL)))


NOTHING_KNOWN = Prior()
"""That of an image of which no target was read yet."""
