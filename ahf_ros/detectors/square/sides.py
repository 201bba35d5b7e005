"""Corners of square markers, from their sides in the image as received.

A side is a straight edge with the dark side inside. Profiles across it are fitted, those that look
like edges of light lose their weight, and a line is fitted to the rest. A corner is the
intersection of the lines of two neighbouring sides, so that light near a corner does not move it.

Where ink or light has grown, all edges have moved by one length. White cells beside the border
show its inner edge, which has moved the other way. From both follows the length, by which lines
are moved back.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.features.edge_errors import (
    common_errors,
    common_slope,
    smooth_slopes,
    unevenness,
    weigh_edges,
)
from ahf_ros.features.frame import project
from ahf_ros.features.profiles import (
    BLURS,
    CORRELATION,
    USUAL_BLUR,
    Edges,
    OutlinePoints,
    measure_outlines,
)
from ahf_ros.features.robust import median, reweight, spread

_PROFILES = 32  # per side
_ENDS = 0.06  # of a side, left out at its ends, where blur rounds the corner
_REACH = 3.0  # half the distance within which a corner may lie from where it was, px
_REACH_IN_WIDTHS = 0.45  # the same in widths of what it limits, as the next edge is that far
_MEASUREMENTS = 5
_OF_COMMON, _BY_LIGHT = 1.2, 2.0  # of the variance, as rendered scenes have it
_ROUNDS = 6  # iterations of robust least squares
_OUTLIER = 3.0  # distance from the line that quarters the weight, in usual distances
_MINIMUM_DISTANCE = 0.02  # minimum of the usual distance, px
_PLACED = 0.25  # maximum distance from the line of an edge that belongs to it, px
_MINIMUM_STEP = 1.0  # minimum height of an edge for its weight, gray values
_LIGHT_REACH = 1.5  # standard deviation of the window that smooths the light, profiles
_LIGHT_PRIOR = 1.0  # weight of the prior, a slope of zero, in profiles
_WEAK_PRIOR = 1e-3  # of the position of a side, in gray values^2 / px^2
_DIFFERENCE = 1e-3  # step of numerical derivatives, px
_MINIMUM_EDGES = 3.0  # independent edges of a side; its line takes two
_NO_WEIGHT = 1e-9  # instead of a sum of no weights
_THROUGH = 0.25  # of what cells behind the border do to a centre, px, by (blur / border)^2
_IN_CELL = (0.35, 0.5, 0.65)  # where the inner edge of the border is measured, in each cell
_MINIMUM_INNER_EDGES = 6  # such edges; the usual one has the shift of all edges
_THICK = 4.0  # width of cells, and so of a border, whose two edges can be separated, blurs
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of the square about the origin with sides of 1."""

SYSTEMATIC = 0.003
"""Standard deviation of the effects of lens distortion and pixels on a centre, px."""

USED = 0.3
"""Share of the edges on each side from which a fit is used."""

_ALONG = np.linspace(_ENDS, 1 - _ENDS, _PROFILES)  # positions of profiles along a side, 0 to 1
_BASIS = np.stack([1 - _ALONG, _ALONG], axis=1)  # of a line, by its offsets at the ends of a side
_INDEX = np.arange(_PROFILES)
_WINDOW = np.exp(-0.5 * ((_INDEX[:, None] - _INDEX) / _LIGHT_REACH) ** 2)


@dataclass(frozen=True, slots=True)
class Sides:
    """Square markers fitted to their sides.

    Attributes
    ----------
    corners : ndarray of float64, shape (k, 4, 2)
        Corners, clockwise in the image, px.
    share : ndarray of float64, shape (k,)
        Fraction of the edges that belong to their line, minimum over the four sides.
    covariance : ndarray of float64, shape (k, 2, 2)
        Covariance of the centre, px^2.
    edge_shift : ndarray of float64, shape (k,)
        Length by which dark areas are larger in the image than in the print, on every edge, px;
        NaN where that was not measured. The corners are those without it.
    """

    corners: np.ndarray
    share: np.ndarray
    covariance: np.ndarray
    edge_shift: np.ndarray

    @classmethod
    def unmeasured(cls, corners: np.ndarray) -> Sides:
        """Return markers of which only corners are known."""
        count = len(corners)
        return cls(corners, np.zeros(count), np.zeros((count, 2, 2)), np.full(count, np.nan))


def centres(corners: np.ndarray) -> np.ndarray:
    """Return the intersections of the diagonals, the images of the centres, shape (k, 2)."""
    return meet(corners[:, 0], corners[:, 2], corners[:, 1], corners[:, 3])


def square_frames(corners: np.ndarray) -> np.ndarray:
    """Return homographies from the square about the origin with sides of 1, shape (k, 3, 3)."""
    square = SQUARE.astype(np.float32)
    found = [cv2.getPerspectiveTransform(square, of.astype(np.float32)) for of in corners]
    return np.array(found).reshape(-1, 3, 3)


def fit_sides(gray: np.ndarray, corners: np.ndarray, cells: int, border: int) -> Sides:
    """Return markers whose corners are the intersections of their sides.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    corners : ndarray of float64, shape (k, 4, 2)
        To about two pixels, clockwise in the image. The border of a marker is dark. Those of
        markers whose share is less than `USED` are returned as they are.
    cells : int
        Number of cells along a side, including the border.
    border : int
        Width of the border, cells.
    """
    rough = corners
    blur, contrast = np.full(len(corners), USUAL_BLUR), np.ones(len(corners))
    share, covariance = np.zeros(len(corners)), np.zeros((len(corners), 2, 2))
    for _ in range(_MEASUREMENTS if len(corners) else 0):
        starts, ends = corners, np.roll(corners, -1, axis=1)
        normals = _normals(starts, ends)
        outlines = _outlines(starts, ends, normals, border / cells)
        edges = measure_outlines(gray, outlines, blur, reach=1.0)
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), *BLURS)
        own = weigh_edges(edges)
        contrast = own.contrast
        step = np.maximum(edges.bright - edges.dark, _MINIMUM_STEP)
        of_side = (len(corners), 4, _PROFILES)
        slopes, uneven = _slopes(edges, own.weights)
        lines = _fit_lines(
            (edges.offset - edges.sensitivity * slopes).reshape(of_side),
            (own.weights * step**2).reshape(of_side),
            own.seen.reshape(of_side),
            edges.spacing.reshape(of_side),
        )
        met, covariance = _corners(starts, ends, normals, lines)
        near = np.linalg.norm(met - starts, axis=2).max(axis=1) < 2 * _REACH
        corners = np.where(near[:, None, None], met, starts)
        share = np.where(near, lines.share.min(axis=1), 0.0)
        cell = np.linalg.norm(ends - starts, axis=2).mean(axis=1) / cells
        through = _THROUGH * (blur / np.maximum(border * cell, 1.0)) ** 2
        covariance *= (1 + _BY_LIGHT * uneven)[:, None, None]
        covariance += (through**2)[:, None, None] * np.eye(2)
    shift = _edge_shift(gray, corners, cells, border, blur, contrast)
    back = np.where(np.isfinite(shift), -shift, 0.0)[:, None, None]
    ends = np.roll(corners, -1, axis=1)
    moved = back * _normals(corners, ends)
    corners = _met(corners + moved, ends + moved)
    corners = np.where((share >= USED)[:, None, None], corners, rough)
    return Sides(corners=corners, share=share, covariance=covariance, edge_shift=shift)


def _edge_shift(
    gray: np.ndarray,
    corners: np.ndarray,
    cells: int,
    border: int,
    blur: np.ndarray,
    contrast: np.ndarray,
) -> np.ndarray:
    """Return by how much dark areas have grown, shape (k,), from both edges of the borders.

    Corners are where the sides that were measured meet. The blur of edges is a standard deviation,
    px, the contrast the ratio of the gray values of ink and paper, both of shape (k,).
    """
    along = np.add.outer(np.arange(border, cells - border), _IN_CELL).ravel() / cells
    side = np.stack([along, np.full(along.size, border / cells)], axis=1) - 0.5
    turns = [np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), turn) for turn in range(4)]
    frames = square_frames(corners)
    points, before, inner = (
        project(frames, np.stack([(side + offset) @ turn.T for turn in turns]))
        for offset in ((0.0, 0.0), (-0.1 / cells, 0.0), (0.0, 0.9 / cells))
    )
    normals = _normals(before, points)
    cell = np.linalg.norm(inner - points, axis=3)
    each = (len(corners), 4 * along.size)
    outlines = OutlinePoints(
        points=points.reshape(*each, 2),
        normals=normals.reshape(*each, 2),
        polarity=-np.ones(each, int),
        scale=_REACH_IN_WIDTHS * cell.reshape(each),
        spacing=(cell * (_IN_CELL[1] - _IN_CELL[0])).reshape(each),
        curvature=np.zeros(each),
    )
    edges = measure_outlines(gray, outlines, blur, reach=1.0)
    halfway = (1 + contrast[:, None]) / 2 * edges.bright
    seen = edges.visible & (edges.bright > _MINIMUM_STEP) & (edges.dark < halfway)
    thick = cell.reshape(each).min(axis=1, initial=np.inf) > _THICK * blur
    # The outer sides, whose places these are relative to, have moved outwards by it.
    shift = -median(edges.offset, seen, np.nan) / (2 - 2 * border / cells)
    return np.where(thick & (seen.sum(axis=1) >= _MINIMUM_INNER_EDGES), shift, np.nan)


def _slopes(edges: Edges, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the slope of the light across edges, smoothed along each side, and its unevenness.

    Slopes, shape (k, m), are shares of the light, 1/px; the unevenness has the shape (k,).
    """
    slopes = edges.slope - common_slope(edges.slope, np.ones_like(edges.slope), weights)
    of_sides = (slopes.reshape(-1, _PROFILES), weights.reshape(-1, _PROFILES))
    light = smooth_slopes(*of_sides, _WINDOW, _LIGHT_PRIOR, rounds=1)
    errors = light.errors.reshape(slopes.shape)
    return light.slope.reshape(slopes.shape), unevenness(errors, weights)


def _normals(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the outward unit normals of sides, shape (..., 2)."""
    sides = ends - starts
    lengths = np.maximum(np.linalg.norm(sides, axis=-1, keepdims=True), 1e-9)
    return np.stack([sides[..., 1], -sides[..., 0]], axis=-1) / lengths


def _outlines(
    starts: np.ndarray, ends: np.ndarray, normals: np.ndarray, border: float
) -> OutlinePoints:
    """Return the expected edges of the sides; the width of the border is a share of a side."""
    count = len(starts)
    points = starts[:, :, None] + _ALONG[:, None] * (ends - starts)[:, :, None]
    lengths = np.linalg.norm(ends - starts, axis=2)
    depth = np.minimum(np.roll(lengths, 1, axis=1), np.roll(lengths, -1, axis=1))
    return OutlinePoints(
        points=points.reshape(count, -1, 2),
        normals=np.repeat(normals, _PROFILES, axis=1),
        polarity=np.ones((count, 4 * _PROFILES), int),
        scale=np.repeat(_REACH_IN_WIDTHS * border * depth, _PROFILES, axis=1),
        spacing=np.repeat(lengths * (_ALONG[1] - _ALONG[0]), _PROFILES, axis=1),
        curvature=np.zeros((count, 4 * _PROFILES)),
    )


@dataclass(frozen=True, slots=True)
class _Lines:
    """Lines fitted to the edges of sides, by their outward offsets at both ends of a side."""

    offsets: np.ndarray  # (k, 4, 2), px
    covariance: np.ndarray  # (k, 4, 2, 2), px^2
    share: np.ndarray  # (k, 4)


def _fit_lines(
    offsets: np.ndarray, weights: np.ndarray, seen: np.ndarray, spacing: np.ndarray
) -> _Lines:
    """Fit lines to the offsets of edges, shape (k, 4, n), by robust least squares."""
    products = (_BASIS[:, :, None] * _BASIS[:, None]).reshape(-1, 4)
    flat = (-1, _PROFILES)

    def solve(robust: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        normal = (robust @ products).reshape(*robust.shape[:2], 2, 2)
        inverse = np.linalg.inv(normal + _WEAK_PRIOR * np.eye(2))
        unknowns = (inverse @ ((robust * offsets) @ _BASIS)[..., None])[..., 0]
        return (unknowns, inverse), np.abs(offsets - unknowns @ _BASIS.T)

    def scale(errors: np.ndarray) -> np.ndarray:
        usual = spread(errors.reshape(flat), seen.reshape(flat), _MINIMUM_DISTANCE)
        return _OUTLIER * usual.reshape(*errors.shape[:2], 1)

    (unknowns, inverse), _, robust = reweight(solve, weights, scale, _ROUNDS)
    errors = offsets - unknowns @ _BASIS.T
    share = (seen & (np.abs(errors) < _PLACED)).mean(axis=2)
    influence = (robust[..., None] * _BASIS) @ inverse
    together = np.maximum(CORRELATION / spacing, 1.0)
    squares = np.maximum((robust**2 * together).sum(axis=2), _NO_WEIGHT)
    count = np.maximum(robust.sum(axis=2) ** 2 / squares, _MINIMUM_EDGES)
    common = common_errors((robust * errors).reshape(flat), np.zeros(_PROFILES))
    shared = common.reshape(*count.shape)
    growth = together * (_OF_COMMON * shared**2 * count / (count - 2))[..., None]
    parts = influence * (errors * np.sqrt(growth))[..., None]
    covariance = np.swapaxes(parts, 2, 3) @ parts
    return _Lines(offsets=unknowns, covariance=covariance, share=share)


def _corners(
    starts: np.ndarray, ends: np.ndarray, normals: np.ndarray, lines: _Lines
) -> tuple[np.ndarray, np.ndarray]:
    """Return the intersections of neighbouring sides, and the covariance of the centres."""

    def met(offsets: np.ndarray) -> np.ndarray:
        return _met(starts + offsets[..., :1] * normals, ends + offsets[..., 1:] * normals)

    corners = met(lines.offsets)
    middle = centres(corners)
    covariance = np.tile(SYSTEMATIC**2 * np.eye(2), (len(corners), 1, 1))
    for side in range(4):
        moved = np.repeat(lines.offsets[None], 2, axis=0)
        moved[:, :, side] += _DIFFERENCE * np.eye(2)[:, None]
        change = np.stack([centres(met(of)) - middle for of in moved], axis=2) / _DIFFERENCE
        covariance += change @ lines.covariance[:, side] @ change.transpose(0, 2, 1)
    return corners, covariance


def _met(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return where sides from first to second points, shape (k, 4, 2), meet those before them."""
    before, behind = (np.roll(of, 1, axis=1) for of in (first, second))
    return meet(before, behind, first, second)


def meet(
    first: np.ndarray, second: np.ndarray, third: np.ndarray, fourth: np.ndarray
) -> np.ndarray:
    """Return the intersections of lines first-second and third-fourth, shape (..., 2) all.

    Those of parallel lines are NaN.
    """
    one, other, between = second - first, fourth - third, third - first
    turn = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    share = between[..., 0] * other[..., 1] - between[..., 1] * other[..., 0]
    turn = np.where(np.abs(turn) < 1e-9, np.nan, turn)
    return first + (share / turn)[..., None] * one
