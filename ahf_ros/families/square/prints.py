"""Square markers from all their edges: their prints, laid over the image.

Once a marker is read, its whole print is known. In even light the image is this print under a
homography, blurred, between a level of ink and one of paper that change slowly across it. All of
this is fitted to the gray values by least squares [1]_, in which every edge between two cells
takes part, so that cells of a pixel and a half suffice. Blurred cells are products of normal
distributions, which makes all derivatives exact but that of the growth of ink, which is
proportional to the gradient of the print.

What the residuals of a cell sum up to says how well a marker is determined, as patterns of light
leave residuals that stretch over cells.

References
----------
.. [1] Baker & Matthews, Lucas-Kanade 20 years on: a unifying framework, Int. J. Comput. Vis.
   56(3), 2004, 221-255, section 3.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ahf_ros.families.square.frames import SQUARE, Places, side_lengths, square_frames
from ahf_ros.vision.edge_errors import grouped_covariance
from ahf_ros.vision.frame import centre_covariance, changed, project
from ahf_ros.vision.growth import growth_in_light
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.profiles import USUAL_BLUR
from ahf_ros.vision.robust import NORMAL, geman_mcclure, geman_mcclure_gain
from ahf_ros.vision.sampling import sample, within

_CELLS = 8  # of a marker whose cells are not known
_MARGIN = 0.6  # of paper around a print that is looked at, cells
_LARGEST_CELL = 12.0  # whose few edges are measured better in profiles, px
_SAMPLES = 4  # along a cell, at most a pixel apart where it is smaller
_OF_OUTLINE = 2  # samples along a cell of a small marker
_ROUNDS = 10
_LARGEST_STEP = 0.5  # of the place of a marker in a round, cells
_SETTLED = 0.02  # the last step of a corner at most, px
_NEAR = 2.0  # distance of corners from where they were, px, where this is more than a cell
_SHARPEST, _SOFTEST = 0.25, 1.0  # deviation of a blur, px and cells
_OUTLIER = 4.0  # residual that quarters the weight, in usual ones
_USUAL_RESIDUAL = 0.3  # minimum, gray values
_AGREES = 0.25  # residual of a sample that looks like the print, in all the contrast there is
_ENOUGH, _HOPELESS = 0.9, 0.7  # share of such samples; where it is less, light is uneven
_RIDGE = 1e-6  # of diagonals of normal matrices, so that they can be inverted
_PLACE = 8  # unknowns of a frame
_LEVELS = 7  # unknowns of the levels of paper and ink, and of growth
_UNKNOWNS = _PLACE + 1 + _LEVELS
_TOGETHER = 50_000  # samples at a time, which bounds the memory


def lay_prints(gray: np.ndarray, markers: Places, prints: np.ndarray) -> Places:
    """Return markers as their prints lie over the image, where these are better determined.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    markers : Places
        The k markers as their edges show them, or with corners to about a third of a cell.
    prints : ndarray of bool, shape (k, n, n)
        Their cells, borders included, True where there is ink.
    """
    cells = prints.shape[1]
    cell = side_lengths(markers.corners).mean(axis=1) / cells
    counts = np.clip(np.ceil(cell), 1, _SAMPLES).astype(int)
    of_edges = np.trace(markers.covariance, axis1=1, axis2=2)
    deviation = np.where(markers.share > 0, of_edges, np.inf)
    for count in np.unique(counts).tolist():
        alike = np.flatnonzero((counts == count) & (cell <= _LARGEST_CELL))
        places = _places(cells, count)
        for which in _parts(alike, len(places) ** 2):
            found = _laid(gray, markers.corners[which], prints[which], places, cells)
            own = np.trace(found.covariance, axis1=1, axis2=2)
            better = (found.share >= _ENOUGH) & (own < deviation[which])
            markers = markers.replaced(which[better], found.select(better))
    return markers


def _blurred(prints: np.ndarray, places: np.ndarray, blur: np.ndarray) -> np.ndarray:
    """Return blurred prints and their derivatives by x, y and blur, shape (4, k, m^2).

    Places along either side have the shape (m,), blurs (k,), both in sides.
    """
    edges = np.linspace(-0.5, 0.5, prints.shape[1] + 1)
    deviations = (places[:, None] - edges) / blur[:, None, None]
    density = np.exp(-(deviations**2) / 2) / np.sqrt(2 * np.pi) / blur[:, None, None]
    shares = -np.diff(normal_integral(deviations))
    of_place, of_blur = -np.diff(density), np.diff(density * deviations)
    ink = prints.astype(np.float64)
    along = shares @ ink, of_place @ ink, of_blur @ ink
    turned = [np.swapaxes(of, 1, 2) for of in (shares, of_place, of_blur)]
    soft = along[2] @ turned[0] + along[0] @ turned[2]
    blurred = (along[0] @ turned[0], along[0] @ turned[1], along[1] @ turned[0], soft)
    return np.stack(blurred).reshape(4, len(prints), -1)


def lay_outlines(gray: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the corners of quadrilaterals, shape (k, 4, 2), as the edges of dark borders show.

    No cell inside is known yet. A contour, whose pixels are nearly as large as the border of a
    small marker is wide, knows less. Quadrilaterals without a dark border stay as they are.
    """
    places = _places(_CELLS, _OF_OUTLINE)
    corners = corners.copy()
    # Less than half of the samples are beside an outline.
    for which in _parts(np.arange(len(corners)), len(places) ** 2 // 2):
        found = _laid(gray, corners[which], np.ones((len(which), 1, 1), bool), places, _CELLS)
        good = found.share >= _ENOUGH
        corners[which[good]] = found.corners[good]
    return corners


def _parts(indices: np.ndarray, samples: int) -> Iterator[np.ndarray]:
    """Yield the indices of markers, with so many samples each, some at a time."""
    size = max(1, _TOGETHER // samples)
    for first in range(0, len(indices), size):
        yield indices[first : first + size]


def _places(cells: int, count: int) -> np.ndarray:
    """Return places along a side, in sides, from its middle, with so many in a cell."""
    reach = 0.5 + _MARGIN / cells
    return np.linspace(-reach, reach, int(np.ceil((cells + 2 * _MARGIN) * count)) + 1)


def _laid(
    gray: np.ndarray, corners: np.ndarray, prints: np.ndarray, places: np.ndarray, cells: int
) -> Places:
    """Return prints laid over the image from corners on, sampled at places along either side.

    Of a print of one cell only what is inside its outline is known, by half of a marker's cell;
    then, the growth of ink is not known.
    """
    grid = np.stack(np.meshgrid(places, places), axis=2).reshape(-1, 2)
    whole = prints.shape[1] > 1
    known = slice(None) if whole else np.abs(grid).max(axis=1) > 0.5 - 0.5 / cells
    grid = grid[known]
    plane = np.stack([np.ones(len(grid)), *grid.T])
    order, first = _by_cells(grid, cells)
    frames, size = square_frames(corners), side_lengths(corners).mean(axis=1)
    blur, levels = USUAL_BLUR / size, np.zeros((len(frames), _LEVELS))
    laid, share = corners.copy(), np.zeros(len(frames))
    normals = np.tile(np.eye(_UNKNOWNS), (len(frames), 1, 1))
    sums = np.zeros((len(frames), _UNKNOWNS, len(first)))
    active = np.arange(len(frames))
    for number in range(_ROUNDS):
        points = project(frames[active], grid)
        values = sample(gray, points).astype(np.float64)
        inside = within(points, gray.shape)
        ink = _blurred(prints[active], places, blur[active])[..., known]
        linear = _of_levels(ink, plane, whole)
        if not number:
            levels = _solved(*_normal_equations(linear, inside, values))
        residual = values - (levels[active, None] @ linear)[:, 0]
        step = levels[active, 3:6] @ plane
        usual = np.maximum(NORMAL * np.median(np.abs(residual), axis=1), _USUAL_RESIDUAL)
        relative = residual / (_OUTLIER * usual[:, None])
        weights = geman_mcclure(inside, relative)
        full = np.concatenate([_of_place(ink, plane, step), -linear], axis=1)
        normal, scores = _normal_equations(full, weights, residual)
        change = -_solved(normal, scores)
        limit = _LARGEST_STEP / cells
        frames[active] = changed(frames[active], np.clip(change[:, :_PLACE], -limit, limit))
        softer = blur[active] + change[:, _PLACE]
        blur[active] = np.clip(softer, _SHARPEST / size[active], _SOFTEST / cells)
        levels[active] += change[:, _PLACE + 1 :]
        there = project(frames[active], SQUARE)
        last = np.linalg.norm(there - laid[active], axis=2).max(axis=1)
        laid[active] = there
        alike = (np.abs(residual) < _AGREES * np.ptp(values, axis=1)[:, None]).mean(axis=1)
        settled = (last < _SETTLED) & inside.all(axis=1) & (step.max(axis=1) < 0)
        which = active[settled]
        gain = geman_mcclure_gain(inside[settled], relative[settled])
        share[which] = alike[settled]
        normals[which], _ = _normal_equations(full[settled], gain, residual[settled])
        sums[which] = np.add.reduceat(scores[settled][..., order], first, axis=2)
        hopeful = (alike > _HOPELESS) | (number == 0)
        active = active[~settled & hopeful]
        if not active.size:
            break
    near = np.linalg.norm(laid - corners, axis=2).max(axis=1) < np.maximum(size / cells, _NEAR)
    contrast = (levels[:, 0] + levels[:, 3]) / np.maximum(levels[:, 0], 1)
    shift = growth_in_light(levels[:, 6] / levels[:, 3] * size, blur * size, contrast)
    covariance = centre_covariance(frames, grouped_covariance(normals, sums))
    return Places(laid, np.where(near, share, 0.0), covariance, shift)


def _of_levels(ink: np.ndarray, plane: np.ndarray, whole: bool) -> np.ndarray:
    """Return the derivatives of gray values by the levels and the growth of ink, (k, 7, n)."""
    shares, x, y, _ = ink
    linear = np.empty((len(shares), _LEVELS, plane.shape[1]))
    linear[:, :3], linear[:, 3:6] = plane, shares[:, None] * plane
    linear[:, 6] = np.hypot(x, y) if whole else 0.0
    return linear


def _of_place(ink: np.ndarray, plane: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the derivatives of residuals by a homography and the blur, (k, 9, n)."""
    x, y, soft = ink[1:] * step
    _, across, down = plane
    moved = (x, y, x * across, x * down, y * across, y * down)
    bent = moved[2] + moved[5]
    return np.stack([*moved, -bent * across, -bent * down, -soft], axis=1)


def _normal_equations(
    rows: np.ndarray, weights: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices that rows, shape (k, m, n), make, and what each sample adds to sums."""
    weighted = rows * weights[:, None]
    normal: np.ndarray = weighted @ np.swapaxes(rows, 1, 2)
    diagonal = np.einsum('kii->ki', normal)
    diagonal += _RIDGE * diagonal + _RIDGE
    weighted *= values[:, None]
    return normal, weighted


def _solved(normal: np.ndarray, scores: np.ndarray) -> np.ndarray:
    solved: np.ndarray = np.linalg.solve(normal, scores.sum(axis=2)[..., None])
    return solved[..., 0]


def _by_cells(grid: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return an order of samples, cell by cell, and where cells begin in it."""
    column, row = np.clip(np.floor((grid.T + 0.5) * cells), -1, cells).astype(int) + 1
    cell = row * (cells + 2) + column
    order = np.argsort(cell, kind='stable')
    return order, np.flatnonzero(np.diff(cell[order], prepend=-1))
