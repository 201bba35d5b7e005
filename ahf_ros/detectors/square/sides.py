"""Corners of square markers, from their sides in the original image.

A side is a straight edge with dark inside: many profiles across it are fitted, those that look
like edges of light lose their weight, and a line is laid through the rest. Corners are where the
lines of neighbouring sides meet, so that light next to a corner does not move it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.edge_weights import weigh_edges
from ahf_ros.features.light_slope import common_slope, smooth_slopes
from ahf_ros.features.profiles import (
    BLURS,
    CORRELATION,
    USUAL_BLUR,
    Edges,
    OutlinePoints,
    measure_outlines,
)
from ahf_ros.features.robust import median, reweight, spread

_PROFILES = 32  # across a side
_ENDS = 0.06  # of a side, where the next one rounds it off
_FARTHEST = 3.0  # to either side that an edge is looked for, px
_IN_CELLS = 0.45  # the same, in cells of the marker: other edges lie a cell away
_MEASUREMENTS = 3
_ROUNDS = 6  # of robust least squares
_OUTLIER = 3.0  # times the usual distance from the line that quarters the weight
_MINIMUM_DISTANCE = 0.02  # that counts as usual, px
_PLACED = 0.25  # distance from the line within which an edge is in its place, px
_MINIMUM_STEP = 1.0  # gray values, that the weight of an edge is computed from
_LIGHT_REACH = 1.5  # standard deviation of the window in which the light is even, profiles
_LIGHT_PRIOR = 1.0  # whole profiles that say as much of the slope as the prior, none, does
_WEAK_PRIOR = 1e-3  # of a side where it is, in gray values^2 / px^2
_DIFFERENCE = 1e-3  # px, for derivatives
_SYSTEMATIC = 0.003  # standard deviation of what lens distortion and pixels do to a centre, px


@dataclass(frozen=True, slots=True)
class Sides:
    """Square markers fitted to their sides.

    Attributes
    ----------
    corners : ndarray of float64, shape (k, 4, 2)
        px, clockwise as seen.
    share : ndarray of float64, shape (k,)
        Share of the edges that are in their place, on the side where it is smallest.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the centre, px^2.
    """

    corners: np.ndarray
    share: np.ndarray
    covariance: np.ndarray


def centres(corners: np.ndarray) -> np.ndarray:
    """Return where the diagonals of markers meet, the images of their centres.

    Parameters
    ----------
    corners : ndarray of float64, shape (k, 4, 2)

    Returns
    -------
    ndarray of float64, shape (k, 2)
    """
    return _meet(corners[:, 0], corners[:, 2], corners[:, 1], corners[:, 3])


def fit_sides(gray: np.ndarray, corners: np.ndarray, cells: int) -> Sides:
    """Move the corners of markers to where their sides meet.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    corners : ndarray of float64, shape (k, 4, 2)
        To about two pixels, clockwise as seen; markers are dark at their border.
    cells : int
        Of a marker along a side, the border included.

    Returns
    -------
    Sides
    """
    blur = np.full(len(corners), USUAL_BLUR)
    share, covariance = np.zeros(len(corners)), np.zeros((len(corners), 2, 2))
    for _ in range(_MEASUREMENTS if len(corners) else 0):
        starts, ends = corners, np.roll(corners, -1, axis=1)
        normals = _normals(starts, ends)
        points, along = _outlines(starts, ends, normals, cells)
        edges = measure_outlines(gray, points, blur, reach=1.0)
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), *BLURS)
        own = weigh_edges(edges)
        step = np.maximum(edges.bright - edges.dark, _MINIMUM_STEP)
        of_side = (len(corners), 4, _PROFILES)
        lines = _fit_lines(
            along,
            (edges.offset - edges.sensitivity * _slopes(edges, own.weights)).reshape(of_side),
            (own.weights * step**2).reshape(of_side),
            own.seen.reshape(of_side),
            edges.spacing.reshape(of_side),
        )
        met, covariance = _corners(starts, ends, normals, lines)
        near = np.linalg.norm(met - starts, axis=2).max(axis=1) < 2 * _FARTHEST
        corners = np.where(near[:, None, None], met, starts)
        share = np.where(near, lines.share.min(axis=1), 0.0)
    return Sides(corners, share, covariance)


def _slopes(edges: Edges, weights: np.ndarray) -> np.ndarray:
    """Return the slope of the light across the edges, smoothed along each side, shape (k, m)."""
    slopes = edges.slope - common_slope(edges.slope, np.ones_like(edges.slope), weights)
    index = np.arange(_PROFILES)
    window = np.exp(-0.5 * ((index[:, None] - index) / _LIGHT_REACH) ** 2)
    of_sides = (slopes.reshape(-1, _PROFILES), weights.reshape(-1, _PROFILES))
    return smooth_slopes(*of_sides, window, _LIGHT_PRIOR, rounds=1).slope.reshape(slopes.shape)


def _normals(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the directions outwards from sides, shape (k, 4, 2) all."""
    ways = ends - starts
    lengths = np.maximum(np.linalg.norm(ways, axis=2, keepdims=True), 1e-9)
    return np.stack([ways[..., 1], -ways[..., 0]], axis=2) / lengths


def _outlines(
    starts: np.ndarray, ends: np.ndarray, normals: np.ndarray, cells: int
) -> tuple[OutlinePoints, np.ndarray]:
    """Return where the edges of the sides are expected, and how far along a side, 0 to 1."""
    count = len(starts)
    along = np.linspace(_ENDS, 1 - _ENDS, _PROFILES)
    points = starts[:, :, None] + along[:, None] * (ends - starts)[:, :, None]
    lengths = np.linalg.norm(ends - starts, axis=2)
    depth = np.minimum(np.roll(lengths, 1, axis=1), np.roll(lengths, -1, axis=1))
    reach = np.minimum(_IN_CELLS * depth / cells, _FARTHEST)

    def repeated(of_sides: np.ndarray) -> np.ndarray:
        return np.repeat(of_sides, _PROFILES, axis=1)

    outlines = OutlinePoints(
        points.reshape(count, -1, 2),
        repeated(normals),
        np.ones((count, 4 * _PROFILES), int),
        repeated(reach),
        repeated(lengths * (along[1] - along[0])),
        np.zeros((count, 4 * _PROFILES)),
    )
    return outlines, along


@dataclass(frozen=True, slots=True)
class _Lines:
    """Lines through the edges of sides: how far outwards they are at the ends of each."""

    offsets: np.ndarray  # (k, 4, 2), px
    covariance: np.ndarray  # (k, 4, 2, 2), px^2
    share: np.ndarray  # (k, 4)


def _fit_lines(
    along: np.ndarray,
    offsets: np.ndarray,
    weights: np.ndarray,
    seen: np.ndarray,
    spacing: np.ndarray,
) -> _Lines:
    """Lay lines through the offsets of edges, shape (k, 4, n), by robust least squares."""
    basis = np.stack([1 - along, along], axis=1)
    flat = (-1, len(along))

    def solve(robust: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        normal = (robust @ _products(basis)).reshape(*robust.shape[:2], 2, 2)
        inverse = np.linalg.inv(normal + _WEAK_PRIOR * np.eye(2))
        unknowns = (inverse @ ((robust * offsets) @ basis)[..., None])[..., 0]
        return (unknowns, inverse), np.abs(offsets - unknowns @ basis.T)

    def scale(errors: np.ndarray) -> np.ndarray:
        usual = spread(errors.reshape(flat), seen.reshape(flat), _MINIMUM_DISTANCE)
        return _OUTLIER * usual.reshape(*errors.shape[:2], 1)

    (unknowns, inverse), _, robust = reweight(solve, weights, scale, _ROUNDS)
    errors = np.abs(offsets - unknowns @ basis.T)
    share = (seen & (errors < _PLACED)).mean(axis=2)
    influence = (robust[..., None] * basis) @ inverse
    together = np.maximum(CORRELATION / spacing, 1.0)
    parts = influence * (errors * np.sqrt(together))[..., None]
    return _Lines(unknowns, np.swapaxes(parts, 2, 3) @ parts, share)


def _products(basis: np.ndarray) -> np.ndarray:
    return (basis[:, :, None] * basis[:, None]).reshape(len(basis), 4)


def _corners(
    starts: np.ndarray, ends: np.ndarray, normals: np.ndarray, lines: _Lines
) -> tuple[np.ndarray, np.ndarray]:
    """Return where lines of neighbouring sides meet, and the covariance of the centres."""

    def met(offsets: np.ndarray) -> np.ndarray:
        first = starts + offsets[..., :1] * normals
        second = ends + offsets[..., 1:] * normals
        before, behind = (np.roll(of, 1, axis=1) for of in (first, second))
        return _meet(before, behind, first, second)

    corners = met(lines.offsets)
    middle = centres(corners)
    covariance = np.tile(_SYSTEMATIC**2 * np.eye(2), (len(corners), 1, 1))
    for side in range(4):
        changes = _DIFFERENCE * np.eye(2)
        moved = np.repeat(lines.offsets[None], 2, axis=0)
        moved[:, :, side] += changes[:, None]
        change = np.stack([centres(met(of)) - middle for of in moved], axis=2) / _DIFFERENCE
        covariance += change @ lines.covariance[:, side] @ change.transpose(0, 2, 1)
    return corners, covariance


def _meet(
    first: np.ndarray, second: np.ndarray, third: np.ndarray, fourth: np.ndarray
) -> np.ndarray:
    """Return where lines from first to second meet those from third to fourth, (..., 2) all.

    Parallel ones meet nowhere: NaN.
    """
    one, other, between = second - first, fourth - third, third - first
    turn = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    share = between[..., 0] * other[..., 1] - between[..., 1] * other[..., 0]
    turn = np.where(np.abs(turn) < 1e-9, np.nan, turn)
    return first + (share / turn)[..., None] * one
