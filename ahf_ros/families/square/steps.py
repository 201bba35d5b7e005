"""Evidence of cells by the steps between them, which are the same in any light.

Where ink meets paper, the logarithm of light has a step of one height, however strong the light
is. Edges of light make steps, too, of any height, but they lie along the lines between cells by
chance only. So steps across these lines are read by likelihood: a step up, a step down, or none,
by a mixture of a normal distribution about each and of one that has steps of all heights. How high
a step of the print is, the sides of the marker show.

What blur mixes into the light of a cell from those beside it is taken out first, line by line. It
is known for a usual image only, so that steps differ by more where it is much.
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
    USUAL_BLUR,
    Evidence,
)
from ahf_ros.families.square.frames import cell_sizes

_ALONG = np.linspace(-0.32, 0.32, 5)  # where steps are taken, from the middle of a line, cells
_ASIDE = 0.3  # on either side of it, cells
_OFFSET = 2.0  # added to gray values before the logarithm, about the noise of dark ones
# Of steps of the print, in usual ones, and what blur adds where all light is of other cells.
_DEVIATION = np.array([0.25, 0.5])
_STRAY = 0.05  # density of steps that light makes, in that of the likeliest ones
_WEIGHT = 0.4  # of a step, as those beside it are much like it
_ANY_LIGHT, _ANY_FIGURE = 5.0, 10.0  # logarithmic odds against a marker that only this shows
_EVEN = 0.8  # mean evidence of the lines about a border, from which levels are read, too


def steps_between_cells(
    gray: np.ndarray, frames: np.ndarray, corners: np.ndarray, cells: int, border: int
) -> tuple[Evidence, np.ndarray]:
    """Return what steps say of quadrilaterals, and whether their levels may say more, (k,).

    Features of words are whether what is behind a line between two cells is darker, and whether
    it is brighter, line by line, upright ones first; see `stepped`.
    """
    side = cells + 2 * border
    seen, features, (ink, square, around), *_ = kernels.step_evidence(
        gray,
        frames,
        cell_sizes(corners, side),
        _ALONG,
        _ASIDE,
        _OFFSET,
        MINIMUM_STEP,
        _DEVIATION,
        _STRAY,
        _WEIGHT,
        BORDER_WEIGHT,
        np.array([CORNER, USUAL_BLUR, SHARPNESS, COVERED]),
        s=side,
        t=side + 1,
        c=side + 2,
        n=cells,
        f=4 * cells * (cells + 1),
    )
    lines = 2 * (side * (side + 1) - cells * (cells + 1))
    which = np.flatnonzero(seen & (around > 0))
    found = Evidence(
        which,
        features[which],
        ink[which] - _ANY_LIGHT,
        square[which] - _ANY_FIGURE,
        np.ones(len(which), bool),
    )
    return found, ~seen | (around > _EVEN * lines)


def stepped(cells: np.ndarray) -> np.ndarray:
    """Return the features of words, bool, shape (..., f), of cells (..., n, n), True for paper."""
    padded = np.pad(cells, [(0, 0)] * (cells.ndim - 2) + [(1, 1), (1, 1)])
    lines = []
    for across in (padded, padded.swapaxes(-1, -2)):
        before, behind = across[..., 1:-1, :-1], across[..., 1:-1, 1:]
        both = np.stack([before & ~behind, behind & ~before], axis=-1)  # (..., n, n + 1, 2)
        lines.append(both.swapaxes(-2, -3))
    return np.stack(lines, axis=-4).reshape(*cells.shape[:-2], -1)
