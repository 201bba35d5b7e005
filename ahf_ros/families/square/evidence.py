"""What the cells of quadrilaterals say of square markers: by their gray levels, or by steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Evidence:
    """What quadrilaterals say of markers within a border; k of these, f features of words."""

    quadrilateral: np.ndarray  # (k,), its index
    features: np.ndarray  # float32, (k, f), by how much each makes the log odds of a marker grow
    ink: np.ndarray  # (k,), logarithmic odds of a marker where all cells are ink
    square: np.ndarray  # (k,), logarithmic odds of square corners
    whole: np.ndarray  # (k,), whether the border is whole, bool


MINIMUM_STEP = 0.35
"""From ink to paper, in the logarithm."""

SIDE = 0.6
"""Minimum share of such steps of each side of the border."""

BORDER_WEIGHT = 0.3
"""Of the border, which is alike in other quadrilaterals, too."""

CORNER = 0.3
"""Distance from a corner of the border where it is seen to be square, cells."""

SHARPNESS = 12.0
"""Logarithmic odds of a cell, by its distance from the middle in steps."""

COVERED = 3.0
"""Maximum of these odds, as a cell may be covered."""

USUAL_BLUR = 0.7
"""Of an image, standard deviation, px."""
