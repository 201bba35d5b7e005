"""Square markers from all their edges: their prints, laid over the image.

Once a marker is read, its whole print is known. In even light the image is this print under a
homography, blurred, between a level of ink and one of paper that change slowly across it. All of
this is fitted to the gray values by least squares [1]_, in which every edge between two cells
takes part, so that cells of a pixel and a half suffice. Blurred cells are products of normal
distributions, which makes all derivatives exact but that of the growth of ink, which is
proportional to the gradient of the print. See kernels/square_prints.c.

What the residuals of a cell sum up to says how well a marker is determined, as patterns of light
leave residuals that stretch over cells.

References
----------
.. [1] Baker & Matthews, Lucas-Kanade 20 years on: a unifying framework, Int. J. Comput. Vis.
   56(3), 2004, 221-255, section 3.
"""

from __future__ import annotations

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.square.frames import SQUARE, Places, side_lengths, square_frames
from ahf_ros.vision.frame import centre_covariance, project
from ahf_ros.vision.growth import growth_in_light
from ahf_ros.vision.profiles import USUAL_BLUR
from ahf_ros.vision.robust import NORMAL

_CELLS = 8  # of a marker whose cells are not known
_MARGIN = 0.6  # of paper around a print that is looked at, cells
_LARGEST_CELL = 12.0  # whose few edges are measured better in profiles, px
_SAMPLES = 4  # along a cell, at most a pixel apart where it is smaller
_OF_OUTLINE = 2  # samples along a cell of a small marker
_ROUNDS = 10
_LARGEST_STEP = 0.5  # of the place of a marker in a round, cells
_SETTLED = 0.02  # the last step of a corner at most, px
_NEAR = 3.0  # distance of corners from where they were, px, where this is more than a cell
_SHARPEST, _SOFTEST = 0.25, 1.0  # deviation of a blur, px and cells
_OUTLIER = 4.0  # residual that quarters the weight, in usual ones
_USUAL_RESIDUAL = 0.3  # minimum, gray values
_AGREES = 0.25  # residual of a sample that looks like the print, in all the contrast there is
_ENOUGH, _HOPELESS = 0.9, 0.7  # share of such samples; where it is less, light is uneven
_RIDGE = 1e-6  # of diagonals of normal matrices, so that they can be inverted
_BLUR, _PAPER, _STEP, _GROWTH = 8, 9, 12, 15  # of the unknowns: in sides, gray values, and sides


def lay_prints(
    gray: np.ndarray, markers: Places, prints: np.ndarray, largest: float = _LARGEST_CELL
) -> Places:
    """Return markers as their prints lie over the image, where these are better determined.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    markers : Places
        The k markers as their edges show them, or with corners to about a third of a cell.
    prints : ndarray of bool, shape (k, n, n)
        Their cells, borders included, True where there is ink.
    largest : float
        Size of a cell, px, up to which prints are laid.
    """
    cells = prints.shape[1]
    cell = side_lengths(markers.corners).mean(axis=1) / cells
    counts = np.clip(np.ceil(cell), 1, _SAMPLES).astype(int)
    of_edges = np.trace(markers.covariance, axis1=1, axis2=2)
    deviation = np.where(markers.share > 0, of_edges, np.inf)
    tried = cell <= largest
    for count in np.unique(counts[tried]).tolist():
        which = np.flatnonzero(tried & (counts == count))
        found = _laid(gray, markers.corners[which], prints[which], count, cells)
        own = np.trace(found.covariance, axis1=1, axis2=2)
        better = (found.share >= _ENOUGH) & (own < deviation[which])
        markers = markers.replaced(which[better], found.select(better))
    return markers


def lay_outlines(gray: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the corners of quadrilaterals, shape (k, 4, 2), as the edges of dark borders show.

    No cell inside is known yet. Straight edges, whose pixels are nearly as large as the border of
    a small marker is wide, know less. Quadrilaterals without a dark border stay as they are.
    """
    corners = corners.copy()
    found = _laid(gray, corners, np.ones((len(corners), 1, 1), bool), _OF_OUTLINE, _CELLS)
    good = found.share >= _ENOUGH
    corners[good] = found.corners[good]
    return corners


def _laid(
    gray: np.ndarray, corners: np.ndarray, prints: np.ndarray, count: int, cells: int
) -> Places:
    """Return prints laid over the image from corners on, with so many samples along a cell.

    Of a print of one cell only what is inside its outline is known, by half of a marker's cell;
    then, the growth of ink is not known.
    """
    if not len(corners):
        return Places.unmeasured(corners)
    reach = 0.5 + _MARGIN / cells
    places = np.linspace(-reach, reach, int(np.ceil((cells + 2 * _MARGIN) * count)) + 1)
    of_cells = np.clip(np.floor((places + 0.5) * cells), -1, cells).astype(np.int32) + 1
    inner = -1.0 if prints.shape[1] > 1 else 0.5 - 0.5 / cells
    size = np.maximum(side_lengths(corners).mean(axis=1), 1.0)
    blurs = np.stack([USUAL_BLUR / size, _SHARPEST / size, 0 * size + _SOFTEST / cells], axis=1)
    of_steps = _LARGEST_STEP / cells, _SETTLED, _OUTLIER, NORMAL, _USUAL_RESIDUAL
    of_rounds = _AGREES, _HOPELESS, _RIDGE, _ROUNDS
    frames, unknowns, share, covariance, *_ = kernels.laid_prints(
        np.asarray(gray, np.float32),
        square_frames(corners),
        prints,
        places,
        of_cells,
        blurs,
        inner,
        *of_steps,
        *of_rounds,
        g=cells + 2,
    )
    laid = project(frames, SQUARE)
    near = np.linalg.norm(laid - corners, axis=2).max(axis=1) < np.maximum(size / cells, _NEAR)
    blur, paper, step, growth = unknowns[:, [_BLUR, _PAPER, _STEP, _GROWTH]].T
    step = np.where(share > 0, step, -1.0)
    contrast = (paper + step) / np.maximum(paper, 1)
    shift = growth_in_light(growth / step * size, blur * size, contrast)
    covariance = centre_covariance(frames, covariance)
    return Places(laid, np.where(near, share, 0.0), covariance, shift)
