"""Square markers from the edges of their print in the image as received.

Once a marker is read, all edges between its cells are known. Profiles across them are fitted,
those that look like edges of light lose their weight, and a frame is fitted to the rest by robust
least squares. Where ink or light has grown, all edges have moved by one length towards the paper,
which is one more unknown.

Paper that covers a side has an edge that may look like the side. The edges inside the marker tell
that it is not: robust least squares have several solutions, and that with most edges is taken.
They are looked for with all edges from the start, and with those inside first.

Paper is not quite flat, and printers do not feed it evenly. Where edges are off by more than the
image tells, their own errors are what is known of the place.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ahf_ros.families.square.frames import SQUARE, Places, side_lengths, square_frames
from ahf_ros.vision.edge_errors import (
    EdgeWeights,
    LightSlope,
    grouped_covariance,
    smooth_slopes,
)
from ahf_ros.vision.edge_fit import WEAK_PRIOR, EdgeKind, Outlines, fit_edges
from ahf_ros.vision.frame import centre_covariance, changed, outline_basis, project, reduced
from ahf_ros.vision.growth import growth_in_light
from ahf_ros.vision.profiles import BLURS, SOFTEST, USUAL_BLUR, Edges
from ahf_ros.vision.pyramid import halved
from ahf_ros.vision.robust import geman_mcclure_gain, median

_ALONG = np.array([0.25, 0.5, 0.75])  # where edges are measured along a cell
_REACH = 0.45  # of profiles, in cells, as the next edge is that far
_SMALLEST_CELL = 2.0  # about the smallest whose profiles are long enough, px
_MEASUREMENTS = 5
_WIDE = 2  # of these, with profiles as long as cells allow
_WIDE_BLUR = 0.18  # for which they are made so long, cells
_INSIDE = 3  # of these, without the sides where one of them may not be the marker's
_ROUNDS = 6  # iterations of robust least squares
_MINIMUM_ERROR = 0.02  # minimum of the usual error, px
_PLACED = 0.15  # maximum error of an edge that is where it should be, px
_NOT_FLAT = 0.05  # the same of a print that is bent or printed unevenly, cells
_OF_SLOPE = 0.55  # share of edges that a slope of the light may look like: those of its direction
_ENOUGH = 0.4  # share of edges where they should be; where it is less, there is no marker
_DOUBTFUL = 0.8  # the same; where it is less, a side may not be the marker's
_LIGHT_REACH = 1.5  # standard deviation of the window that smooths the light, profiles
_LIGHT_PRIOR = 1.0  # weight of the prior, a slope of zero, in profiles
_THROUGH = 6.0  # of what the next edges do to a centre, px, by (blur / cell)^4
_TOGETHER = 200  # markers at a time, which bounds the memory


def fit_markers(
    gray: np.ndarray, corners: np.ndarray, prints: np.ndarray, *, flat: bool = True
) -> Places:
    """Return markers placed by the edges of their prints, or unmeasured where these are not seen.

    Edges that are softer than profiles are measured in the image at half its size.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    corners : ndarray of float64, shape (k, 4, 2)
        To about two pixels, but for those of a side that is not the marker's; clockwise in the
        image, the first one that of the upright marker.
    prints : ndarray of bool, shape (k, n, n)
        Their cells, borders included, True where there is ink.
    flat : bool
        Whether they are flat. Edges of others may be farther off, which adds to the covariance.
    """
    places, blurs = Places.unmeasured(corners), np.zeros(len(corners))
    large = side_lengths(corners).min(axis=1) >= _SMALLEST_CELL * prints.shape[1]
    for first in range(0, len(corners), _TOGETHER):
        which = first + np.flatnonzero(large[first : first + _TOGETHER])
        for inside_first in (False, True):
            if not which.size:
                break
            found, blur = _fitted(gray, corners[which], prints[which], inside_first, flat)
            better = found.share > places.share[which]
            blurs[which[better]] = blur[better]
            places = places.replaced(which[better], found.select(better))
            which = which[places.share[which] < _DOUBTFUL]
    refused = places.share < _ENOUGH
    places = places.replaced(refused, Places.unmeasured(corners[refused]))
    soft = np.flatnonzero((blurs >= SOFTEST) & ~refused)
    if not soft.size:
        return places
    half, smaller = halved(gray, 1)[1], reduced(places.corners[soft], 1)
    again = fit_markers(half, smaller, prints[soft], flat=flat)
    seen = again.share >= places.share[soft]
    return places.replaced(soft[seen], again.select(seen).enlarged())


@lru_cache
def _grid(cells: int) -> Outlines:
    """Return places on the lines between cells, line by line, first those from top to bottom.

    Group 0 has the sides, group 1 what is inside.
    """
    lines = np.linspace(-0.5, 0.5, cells + 1)
    along = (np.arange(cells)[:, None] + _ALONG).ravel() / cells - 0.5
    across, along = (of.ravel() for of in np.meshgrid(lines, along, indexing='ij'))
    upright = np.stack([across, along], axis=1)
    straight = np.zeros(2 * across.size)
    return Outlines(
        points=np.concatenate([upright, upright[:, ::-1]]),
        normals=np.eye(2).repeat(across.size, axis=0),
        curvature=straight,
        spacing=straight + 1 / (cells * len(_ALONG)),
        line=np.arange(2 * len(lines)).repeat(cells * len(_ALONG)),
        group=np.tile(np.abs(across) < 0.5, 2).astype(int),
        polarity=np.zeros((0, 2 * across.size), int),
    )


def _polarity(prints: np.ndarray) -> np.ndarray:
    """Return 1 where ink is before a line between cells and paper behind, -1, or 0, (k, m)."""
    ink = np.pad(prints, ((0, 0), (1, 1), (1, 1))).astype(int)
    upright = -np.diff(ink, axis=2)[:, 1:-1].swapaxes(1, 2)
    level = -np.diff(ink, axis=1)[:, :, 1:-1]
    each = np.stack([upright, level], axis=1).repeat(len(_ALONG), axis=3)
    return each.reshape(len(prints), -1)


@lru_cache
def _kind(cells: int) -> EdgeKind:
    """Return what moves the edges of markers: a frame, and the growth of ink."""
    grid, index = _grid(cells), np.arange(cells * len(_ALONG))
    window = np.exp(-0.5 * ((index[:, None] - index) / _LIGHT_REACH) ** 2).astype(np.float32)

    def smooth(edges: Edges, own: EdgeWeights, polarity: np.ndarray) -> LightSlope:
        prior = np.full(len(polarity), _LIGHT_PRIOR)
        return smooth_slopes(edges, polarity, own.weights, window, prior, np.inf, rounds=1)

    basis = outline_basis(grid.points, grid.normals)
    prior = np.full(basis.shape[1] + 1, WEAK_PRIOR)
    return EdgeKind(basis, prior, smooth, 'px', _MINIMUM_ERROR, _ROUNDS)


def _fitted(
    gray: np.ndarray, corners: np.ndarray, prints: np.ndarray, inside_first: bool, flat: bool
) -> tuple[Places, np.ndarray]:
    """Return markers fitted to their edges, or at first to those inside, and their blur, px."""
    cells = prints.shape[1]
    grid, kind, expected = _grid(cells), _kind(cells), _polarity(prints)
    frames, cell = square_frames(corners), side_lengths(corners).min(axis=1) / cells
    blur = np.full(len(corners), USUAL_BLUR)
    for number in range(_MEASUREMENTS):
        left_out = (grid.group == 0) & (inside_first and number < _INSIDE)
        outlines = replace(grid, polarity=np.where(left_out, 0, expected))
        used = np.clip(_WIDE_BLUR * cell, blur, BLURS[1]) if number < _WIDE else blur
        fit = fit_edges(gray, frames, outlines, kind, used, _REACH / cells)
        edges, own = fit.edges, fit.own
        if number:
            blur = np.clip(used + median(edges.softness, edges.visible, 0.0), *BLURS)
        frames = changed(frames, fit.unknowns[:, :-1])
    errors = np.abs(fit.errors * edges.scale)
    limits = np.maximum(_PLACED, (not flat) * _NOT_FLAT * cell)
    placed = own.seen & (errors < limits[:, None])
    count = np.maximum((outlines.polarity != 0).sum(axis=1), 1)
    share = np.where(own.seen.sum(axis=1) > _OF_SLOPE * count, placed.sum(axis=1) / count, 0.0)
    basis = np.broadcast_to(kind.basis, (*edges.scale.shape, kind.basis.shape[1]))
    rows = np.concatenate([basis, (expected / edges.scale)[..., None]], axis=2)
    scores = (fit.robust * fit.errors)[..., None] * rows
    of_cells = scores.reshape(len(corners), -1, len(_ALONG), scores.shape[2]).sum(axis=2)
    gained = geman_mcclure_gain(fit.weights, fit.relative)[..., None] * rows
    normal = np.diag(kind.prior) + rows.swapaxes(1, 2) @ gained
    covariance = centre_covariance(frames, grouped_covariance(normal, of_cells.swapaxes(1, 2)))
    through = _THROUGH * (blur / cell) ** 4
    covariance += (through**2)[:, None, None] * np.eye(2)
    if not flat:  # errors of neighbouring edges have much in common
        bent = (own.seen * errors**2).sum(axis=1) / np.maximum(own.seen.sum(axis=1), 1)
        covariance += bent[:, None, None] * np.eye(2)
    growth = growth_in_light(fit.unknowns[:, -1], blur, own.contrast)
    return Places(project(frames, SQUARE), share, covariance, growth), blur
