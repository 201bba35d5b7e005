"""Square markers from the edges of their print in the image as received.

Once a marker is read, all edges between its cells are known. Profiles across them are fitted,
those that look like edges of light lose their weight, and a frame is fitted to the rest by robust
least squares. Where ink or light has grown, all edges have moved by one length towards the paper,
which is one more unknown.

Paper that covers a side has an edge that may look like the side. The edges inside the marker tell
that it is not: robust least squares have several solutions, and that with most edges is taken.
They are looked for with all edges from the start, and with those inside first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ahf_ros.families.square.frames import (
    PLACE,
    SQUARE,
    Places,
    centre_covariance,
    changed,
    side_lengths,
    square_frames,
)
from ahf_ros.vision.edge_errors import common_slope, smooth_slopes, weigh_edges
from ahf_ros.vision.frame import project
from ahf_ros.vision.growth import growth_in_light
from ahf_ros.vision.profiles import (
    BLURS,
    USUAL_BLUR,
    Edges,
    OutlinePoints,
    measure_outlines,
)
from ahf_ros.vision.robust import geman_mcclure_gain, median, reweight, spread

_ALONG = np.array([0.25, 0.5, 0.75])  # where edges are measured along a cell
_REACH = 0.45  # of profiles, in cells, as the next edge is that far
_SMALLEST_CELL = 2.0  # about the smallest whose profiles are long enough, px
_MEASUREMENTS = 5
_WIDE = 2  # of these, with profiles as long as cells allow
_WIDE_BLUR = 0.18  # for which they are made so long, cells
_INSIDE = 3  # of these, without the sides where one of them may not be the marker's
_LARGEST_CHANGE = 0.5  # of a frame at a time, cells
_ROUNDS = 6  # iterations of robust least squares
_OUTLIER = 3.0  # error that quarters the weight, in usual ones
_MINIMUM_ERROR = 0.02  # minimum of the usual error, px
_PLACED = 0.15  # maximum error of an edge that is where it should be, px
_OF_SLOPE = 0.55  # share of edges that a slope of the light may look like: those of its direction
_ENOUGH = 0.4  # share of edges where they should be; where it is less, there is no marker
_DOUBTFUL = 0.8  # the same; where it is less, a side may not be the marker's
_MINIMUM_STEP = 1.0  # minimum height of an edge for its weight, gray values
_LIGHT_REACH = 1.5  # standard deviation of the window that smooths the light, profiles
_LIGHT_PRIOR = 1.0  # weight of the prior, a slope of zero, in profiles
_RIDGE = 1e-6, 1e-3  # of diagonals of normal matrices, so that they can be inverted
_THROUGH = 6.0  # of what the next edges do to a centre, px, by (blur / cell)^4
_DIFFERENCE = 0.05  # step of numerical derivatives, cells
_TOGETHER = 200  # markers at a time, which bounds the memory


def fit_edges(gray: np.ndarray, corners: np.ndarray, prints: np.ndarray) -> Places:
    """Return markers placed by the edges of their prints, or unmeasured where these are not seen.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    corners : ndarray of float64, shape (k, 4, 2)
        To about two pixels, but for those of a side that is not the marker's; clockwise in the
        image, the first one that of the upright marker.
    prints : ndarray of bool, shape (k, n, n)
        Their cells, borders included, True where there is ink.
    """
    places = Places.unmeasured(corners)
    large = side_lengths(corners).min(axis=1) >= _SMALLEST_CELL * prints.shape[1]
    for first in range(0, len(corners), _TOGETHER):
        which = first + np.flatnonzero(large[first : first + _TOGETHER])
        for inside_first in (False, True):
            if not which.size:
                break
            found = _fitted(gray, corners[which], prints[which], inside_first)
            better = found.share > places.share[which]
            places = places.replaced(which[better], found.select(better))
            which = which[places.share[which] < _DOUBTFUL]
    refused = places.share < _ENOUGH
    return places.replaced(refused, Places.unmeasured(corners[refused]))


@dataclass(frozen=True, slots=True)
class _Grid:
    """Places on the lines between cells, line by line, first of those from top to bottom."""

    points: np.ndarray  # (m, 2), in sides
    upright: np.ndarray  # (m,), whether the line is one from top to bottom
    moved: np.ndarray  # (m, 8), across the line, in sides, by the unknowns of a frame
    inside: np.ndarray  # (m,), whether the line is no side


@lru_cache
def _grid(cells: int) -> _Grid:
    lines = np.linspace(-0.5, 0.5, cells + 1)
    along = (np.arange(cells)[:, None] + _ALONG).ravel() / cells - 0.5
    across, along = (of.ravel() for of in np.meshgrid(lines, along, indexing='ij'))
    none, one = np.zeros_like(across), np.ones_like(across)
    bent = [-across * across, -across * along]
    upright = [across, along, one, none, none, none, *bent]
    level = [none, none, none, along, across, one, *bent[::-1]]
    return _Grid(
        points=np.concatenate([np.stack([across, along], 1), np.stack([along, across], 1)]),
        upright=np.repeat([True, False], across.size),
        moved=np.concatenate([np.stack(upright, 1), np.stack(level, 1)]),
        inside=np.tile(np.abs(across) < 0.5, 2),
    )


def _polarity(prints: np.ndarray) -> np.ndarray:
    """Return 1 where ink is before a line between cells and paper behind, -1, or 0, (k, m)."""
    ink = np.pad(prints, ((0, 0), (1, 1), (1, 1))).astype(int)
    upright = -np.diff(ink, axis=2)[:, 1:-1].swapaxes(1, 2)
    level = -np.diff(ink, axis=1)[:, :, 1:-1]
    each = np.stack([upright, level], axis=1).repeat(len(_ALONG), axis=3)
    return each.reshape(len(prints), -1)


def _fitted(
    gray: np.ndarray, corners: np.ndarray, prints: np.ndarray, inside_first: bool
) -> Places:
    """Return markers fitted to their edges, or at first to those inside."""
    cells = prints.shape[1]
    grid, expected = _grid(cells), _polarity(prints)
    frames, cell = square_frames(corners), side_lengths(corners).min(axis=1) / cells
    blur = np.full(len(corners), USUAL_BLUR)
    for number in range(_MEASUREMENTS):
        left_out = ~grid.inside & (inside_first and number < _INSIDE)
        polarity = np.where(left_out, 0, expected)
        used = np.maximum(blur, _WIDE_BLUR * cell) if number < _WIDE else blur
        edges = _measured(gray, frames, polarity, cells, used)
        if number:
            blur = np.clip(used + median(edges.softness, edges.visible, 0.0), *BLURS)
        own = weigh_edges(edges)
        step = np.maximum(edges.bright - edges.dark, _MINIMUM_STEP)
        offset = edges.offset - edges.sensitivity * _slopes(edges, polarity, own.weights, cells)
        size = edges.scale / _REACH * cells
        solution = _solved(grid.moved, size, polarity, offset, own.weights * step**2, own.seen)
        limit = _LARGEST_CHANGE / cells
        frames = changed(frames, np.clip(solution.unknowns[:, :PLACE], -limit, limit))
    placed = own.seen & (np.abs(solution.errors) < _PLACED)
    count = np.maximum((polarity != 0).sum(axis=1), 1)
    share = np.where(own.seen.sum(axis=1) > _OF_SLOPE * count, placed.sum(axis=1) / count, 0.0)
    of_cells = solution.scores.reshape(len(corners), -1, len(_ALONG), PLACE + 1).sum(axis=2)
    covariance = centre_covariance(frames, solution.normal, of_cells.swapaxes(1, 2))
    through = _THROUGH * (blur / cell) ** 4
    covariance += (through**2)[:, None, None] * np.eye(2)
    growth = growth_in_light(solution.unknowns[:, PLACE], blur, own.contrast)
    return Places(project(frames, SQUARE), share, covariance, growth)


def _measured(
    gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray, cells: int, blur: np.ndarray
) -> Edges:
    """Return the edges on the lines between cells."""
    grid, step = _grid(cells), _DIFFERENCE / cells
    axis = step * np.eye(2)
    along = np.where(grid.upright[:, None], axis[1], axis[0])
    points, ahead, back, behind = (
        project(frames, grid.points + of) for of in (0.0, along, -along, along[:, ::-1])
    )
    tangents = ahead - back
    lengths = np.maximum(np.linalg.norm(tangents, axis=2), 1e-9)
    normals = np.stack([tangents[..., 1], -tangents[..., 0]], axis=2) / lengths[..., None]
    normals[:, ~grid.upright] *= -1
    across = ((behind - points) * normals).sum(axis=2) / _DIFFERENCE
    outlines = OutlinePoints(
        points=points,
        normals=normals,
        polarity=polarity,
        scale=_REACH * np.maximum(across, 0.0),
        spacing=lengths / (2 * _DIFFERENCE * len(_ALONG)),
        curvature=np.zeros_like(lengths),
    )
    return measure_outlines(gray, outlines, blur, reach=1.0)


def _slopes(edges: Edges, polarity: np.ndarray, weights: np.ndarray, cells: int) -> np.ndarray:
    """Return the slope of the light across edges, smoothed along each line, (k, m), 1/px."""
    slopes = edges.slope - polarity * common_slope(edges.slope, polarity, weights)
    count = cells * len(_ALONG)
    of_lines = slopes.reshape(-1, count), weights.reshape(-1, count)
    light = smooth_slopes(*of_lines, _window(count), _LIGHT_PRIOR, rounds=1)
    return light.slope.reshape(slopes.shape)


@lru_cache
def _window(count: int) -> np.ndarray:
    index = np.arange(count)
    return np.exp(-0.5 * ((index[:, None] - index) / _LIGHT_REACH) ** 2)


@dataclass(frozen=True, slots=True)
class _Solution:
    unknowns: np.ndarray  # (k, 9), of a frame, and the growth of ink, px
    normal: np.ndarray  # (k, 9, 9)
    errors: np.ndarray  # (k, m), px
    scores: np.ndarray  # (k, m, 9), what each error adds to the right sides


def _solved(
    moved: np.ndarray,
    size: np.ndarray,
    grown: np.ndarray,
    offsets: np.ndarray,
    weights: np.ndarray,
    seen: np.ndarray,
) -> _Solution:
    """Fit offsets of edges, px, shape (k, m), by robust least squares.

    They are moved by a frame, in sides of some sizes, px, and by the growth of ink, shape (k, m).
    """
    products = (moved[:, :, None] * moved[:, None]).reshape(len(moved), -1)
    count = len(offsets)

    def normal(weights: np.ndarray) -> np.ndarray:
        matrix = np.empty((count, PLACE + 1, PLACE + 1))
        across, along = weights * size, weights * grown
        matrix[:, :PLACE, :PLACE] = (across * size @ products).reshape(count, PLACE, PLACE)
        matrix[:, PLACE, :PLACE] = matrix[:, :PLACE, PLACE] = across * grown @ moved
        matrix[:, PLACE, PLACE] = (along * grown).sum(axis=1)
        diagonal = np.einsum('kii->ki', matrix)
        diagonal += _RIDGE[0] * diagonal + _RIDGE[1]
        return matrix

    def solve(robust: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        weighted = robust * offsets
        right = np.column_stack([weighted * size @ moved, (weighted * grown).sum(axis=1)])
        unknowns = np.linalg.solve(normal(robust), right[..., None])[..., 0]
        errors = offsets - size * (unknowns[:, :PLACE] @ moved.T) - grown * unknowns[:, PLACE:]
        return (unknowns, errors), np.abs(errors)

    def scale(errors: np.ndarray) -> np.ndarray:
        return _OUTLIER * spread(errors, seen, _MINIMUM_ERROR)

    (unknowns, errors), scaled, robust = reweight(solve, weights, scale, _ROUNDS)
    weighted = robust * errors
    scores = np.concatenate(
        [(weighted * size)[..., None] * moved, (weighted * grown)[..., None]], axis=2
    )
    return _Solution(unknowns, normal(geman_mcclure_gain(weights, scaled)), errors, scores)
