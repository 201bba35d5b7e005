"""Evidence of cells by their gray levels, each between ink and paper in its light.

All cells of the grid that a dictionary has are sampled, those of the border and one more around it
with them. Ink and paper next to each other in these two rings tell what ink and paper are in the
light of each cell. A cell speaks for paper by where it is between these levels, but never by more
than it would if it may be covered.
"""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.square.evidence import (
    BORDER_WEIGHT,
    CORNER,
    COVERED,
    MINIMUM_STEP,
    SHARPNESS,
    SIDE,
    USUAL_BLUR,
    Evidence,
)
from ahf_ros.families.square.frames import cell_sizes
from ahf_ros.vision.logarithm import LOG_OFFSET

_IN_CELL = ((0.0, 0.0), (-0.2, -0.2), (-0.2, 0.2), (0.2, -0.2), (0.2, 0.2))
"""Where a cell is sampled, from its centre, in cells."""

_UNUSUAL = 3.0  # log odds against light that spreads over ink, or changes within a marker
_MOST_MIXED = 0.2  # share that a cell takes from each neighbour, at most
_REACH = 0.25  # standard deviation of the window that levels are taken from, in sides
_EVERYWHERE = 1e-6  # weight of all others, if there is none in this window
_OF_USUAL = 0.4  # minimum of a step of the border, in usual ones
_UNCLEAR = 1.5  # logarithmic odds against a cell that is between ink and paper
_PART_WEIGHT = 0.15  # of each part of a cell, which have one colour in other quadrilaterals, too
_CORNER_WEIGHT = 0.7
_WHOLE = -1.0  # logarithmic odds of the cells of a border, from which it is whole


def levels_of_cells(
    gray: np.ndarray,
    frames: np.ndarray,
    corners: np.ndarray,
    cells: int,
    border: int,
) -> Evidence:
    """Return what the cells of quadrilaterals within a border say.

    All are there twice, once by the darkest part of each cell, as where light has spread from
    paper over ink.
    """
    side = cells + 2 * border
    count = len(frames)
    reach = (np.arange(side + 2) / (_REACH * (side + 2))) ** 2
    of_levels = LOG_OFFSET, _MOST_MIXED, MINIMUM_STEP, _OF_USUAL, SIDE, _EVERYWHERE
    weights = np.array([_PART_WEIGHT, BORDER_WEIGHT, _CORNER_WEIGHT])
    seen, paper, (ink, square, around), *_ = kernels.cell_evidence(
        gray,
        frames,
        cell_sizes(corners, side),
        np.full(count, USUAL_BLUR),
        np.ones(count, bool),
        kernels.exponentials(-reach / 2),
        np.array(_IN_CELL),
        *of_levels,
        SHARPNESS,
        COVERED,
        _UNCLEAR,
        _UNUSUAL,
        weights,
        CORNER,
        n=cells,
    )
    which = np.flatnonzero(seen)
    ink, square, around = (of.ravel()[which] for of in (ink, square, around))
    return Evidence(
        which % count,
        paper.reshape(-1, cells**2)[which],
        ink,
        square,
        (around > _WHOLE) & (square > 0),
    )
