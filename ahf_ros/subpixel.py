"""Sub-pixel frames of targets, from the edges of their circles in the original image.

Along each radius a blurred step is fitted to the gray values, and the frame is moved onto the
steps by robust weighted least squares. An edge of light that crosses a target leaves steps that do
not fit the circles, or have the wrong contrast: they lose their weight.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from math import erf, pi, sqrt

import numpy as np

from ahf_ros import frame
from ahf_ros.codes.ring import Family

SAMPLES_PER_SECTOR = 10
"""Points on each edge of the band, a sector."""

_HALF_WIDTHS = np.array([0.0, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0])  # of an edge's profile, px
_SAMPLES = 13  # of a profile
_BLUR = 1.0  # standard deviation of the step, px; a wrong one costs precision, moves nothing
_NOISE = 1.0  # of gray values, of 255; the fit scales it to what it finds
_INNER_PART = 0.4  # of a sector, to either side; next to its ends the blur rounds an arc off
_LEAST_CONTRAST = 0.3  # of an edge, in steps of ln of the usual edge of the target
_OFFSET = 8.0  # added to gray values before the logarithm
_PRIOR_SCALE = 0.003  # standard deviation of the printed proportions of band and dot
_PRIOR_PERSPECTIVE = 0.02  # of the projective part, in 1 a dot radius
_PRIOR_SHIFT = 1.0  # of the shift of edges towards the dark side, px


@dataclass(frozen=True, slots=True)
class Circles:
    """Points on the circles of k targets where edges are expected.

    Attributes
    ----------
    angles, radii : ndarray of float64, shape (m,)
        In the frame, rad and dot radii.
    polarity : ndarray of int, shape (k, m)
        1 where the outside is brighter, -1 where it is darker, 0 where there is no edge.
    """

    angles: np.ndarray
    radii: np.ndarray
    polarity: np.ndarray


@dataclass(frozen=True, slots=True)
class Fit:
    """Frames fitted to edges.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of an edge over that of the bright side.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were found in their place.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of the edges that were, px.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    """

    frames: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray

    def chosen(self, which: np.ndarray) -> Fit:
        """Return the fits of some of the frames."""
        return Fit(*(getattr(self, item.name)[which] for item in fields(self)))


def dot_circles(signs: np.ndarray, rays: int) -> Circles:
    """Return the edges of dots.

    Parameters
    ----------
    signs : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points.
    """
    angles = 2 * np.pi * np.arange(rays) / rays
    return Circles(angles, np.ones(rays), np.repeat(np.asarray(signs)[:, None], rays, axis=1))


def ring_circles(
    words: np.ndarray, starts: np.ndarray, signs: np.ndarray, rays: int, family: Family
) -> Circles:
    """Return the edges of ring targets: round the dots and along the marked sectors.

    Parameters
    ----------
    words : ndarray of int64, shape (k,)
        Code words, in any rotation.
    starts : ndarray of float, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    signs : ndarray of int, shape (k,)
        1 for a dark target, -1 for a bright one.
    rays : int
        Number of points round the dot.
    family : Family
    """
    dot = dot_circles(signs, rays)
    count = family.bits * SAMPLES_PER_SECTOR
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    sector, place = np.divmod((angles - starts[:, None]) * family.bits / (2 * np.pi), 1)
    bits = words[:, None] >> sector.astype(np.int64) % family.bits & 1
    marked = np.where(np.abs(place - 0.5) < _INNER_PART, bits, 0) * signs[:, None]
    return Circles(
        np.concatenate([dot.angles, -angles, -angles]),
        np.concatenate([dot.radii, np.repeat([family.band_inner, family.band_outer], count)]),
        np.concatenate([dot.polarity, -marked, marked], axis=1),
    )


def fit_circles(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    *,
    reach: float,
    projective: bool,
    rounds: int = 2,
) -> Fit:
    """Move frames onto the edges of circles.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        To about two pixels.
    circles : Circles
    reach : float
        How far from an expected edge to look, dot radii.
    projective : bool
        Whether the circles have different radii, so that they show where the common centre is.
        Without, the centre is that of the ellipse.
    rounds : int
        Number of measurements.

    Returns
    -------
    Fit
    """
    for _ in range(rounds):
        edges = _measure(gray, frames, circles, reach)
        changes, fit = _solve(frames, circles, edges, projective)
        frames = frame.moved(frames, np.clip(changes[:, : 7 if projective else 5], -0.3, 0.3))
    affine = frame.local_affine(frames)
    covariance = affine @ fit.covariance @ affine.transpose(0, 2, 1)
    return replace(fit, frames=frames, covariance=covariance)


@dataclass(frozen=True, slots=True)
class _Edges:
    offset: np.ndarray  # outwards, px
    inside: np.ndarray  # gray value
    outside: np.ndarray
    scale: np.ndarray  # px a dot radius, along the radius
    visible: np.ndarray  # whether the profile lies in the image


def _measure(gray: np.ndarray, frames: np.ndarray, circles: Circles, reach: float) -> _Edges:
    """Fit a blurred step to the gray values along each radius."""
    directions = np.stack([np.cos(circles.angles), np.sin(circles.angles)], axis=-1)
    points = circles.radii[:, None] * directions
    centre = frame.project(frames, points)
    outwards = (frame.project(frames, points + 1e-3 * directions) - centre) / 1e-3
    scale = np.linalg.norm(outwards, axis=-1)
    step = (outwards / scale[..., None]).astype(np.float32)
    place, inside, outside = (np.zeros(scale.shape) for _ in range(3))
    visible = np.zeros(scale.shape, bool)
    which = np.searchsorted(_HALF_WIDTHS, reach * scale, side='right') - 1
    for index, half in enumerate(_HALF_WIDTHS[1:], start=1):
        ends = half * step
        whole = frame.within(centre - ends, gray.shape) & frame.within(centre + ends, gray.shape)
        chosen = (which == index) & (circles.polarity != 0) & whole
        visible |= chosen
        along = np.linspace(-half, half, _SAMPLES, dtype=np.float32)
        pixels = centre[chosen][:, None] + along[:, None] * step[chosen][:, None]
        steps = _fit_steps(frame.sample(gray, pixels), circles.polarity[chosen], half)
        place[chosen], inside[chosen], outside[chosen] = steps
    return _Edges(place, inside, outside, scale, visible)


def _fit_steps(
    values: np.ndarray, polarity: np.ndarray, half: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit a blurred step to profiles, shape (k, n); return its place and the levels beside it.

    The fit is linear about each of a row of places; the one with the least residual is taken.
    """
    places, projections, solutions = _step_filters(half)
    energy = (values**2).sum(axis=1)[:, None]
    explained = ((values @ projections).reshape(len(values), len(places), 2) ** 2).sum(axis=2)
    solved = (values @ solutions).reshape(len(values), len(places), 3)
    contrast = solved[:, :, 1] - solved[:, :, 0]
    cost = energy - explained
    cost[contrast * polarity[:, None] <= 0] = np.inf
    best = cost.argmin(axis=1)
    rows = np.arange(len(values))
    low, high, moved = solved[rows, best].T
    spacing = places[1] - places[0]
    change = -moved / np.where(np.abs(high - low) < 1, 1, high - low)
    return places[best] + np.clip(change, -spacing, spacing), low, high


@cache
def _step_filters(half: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the places tried, a basis of the steps at each, and the filters that fit them.

    The filters' unknowns are the levels inside and outside, and minus the contrast times the
    distance of the step from the place.
    """
    along = np.linspace(-half, half, _SAMPLES)
    places = np.arange(-0.8 * half, 0.8 * half + 1e-9, 0.1 * half)
    projections, solutions = [], []
    for place in places:
        scaled = (along - place) / _BLUR
        rise = 0.5 * (1 + np.array([erf(value / sqrt(2)) for value in scaled]))
        slope = np.exp(-0.5 * scaled**2) / (_BLUR * sqrt(2 * pi))
        design = np.stack([1 - rise, rise, slope], axis=1)
        projections.append(np.linalg.qr(design[:, :2])[0])
        solutions.append(np.linalg.pinv(design).T)
    basis, filters = (np.concatenate(of, axis=1) for of in (projections, solutions))
    return places, basis.astype(np.float32), filters.astype(np.float32)


def _solve(
    frames: np.ndarray, circles: Circles, edges: _Edges, projective: bool
) -> tuple[np.ndarray, Fit]:
    """Return the changes of the frames that bring the circles onto the edges."""
    polarity = circles.polarity
    expected = edges.visible
    inside, outside = np.maximum(edges.inside, 0), np.maximum(edges.outside, 0)
    step = polarity * np.log((outside + _OFFSET) / (inside + _OFFSET))
    usual = _median(step, expected)
    seen = expected & (step > _LEAST_CONTRAST * usual[:, None]) & (step > 0)
    dark, bright = np.minimum(inside, outside), np.maximum(inside, outside)
    contrast = _median(dark / np.maximum(bright, 1.0), seen)

    noise = _NOISE * np.sqrt(2 * np.sqrt(np.pi) * _BLUR)
    deviation = noise / np.maximum(np.abs(edges.outside - edges.inside), 1.0) / edges.scale
    basis, prior = _basis(circles, edges.scale, projective)
    displacement = edges.offset / edges.scale
    weights = seen / deviation**2
    robust = weights
    for _ in range(6):
        changes, normal = _least_squares(displacement, robust, basis, prior)
        errors = (displacement - (basis @ changes[..., None])[..., 0]) / deviation
        spread = np.maximum(1.4826 * _median(np.abs(errors), seen), 0.5)[:, None]
        trust = 1 / (1 + (errors / (3 * spread)) ** 2) ** 2
        robust = weights * trust
    placed = seen & (np.abs(errors) < 4 * spread) & (np.abs(errors * deviation) < 0.08)
    share = placed.sum(axis=1) / np.maximum(expected.sum(axis=1), 1)
    offsets = np.where(placed, errors * deviation * edges.scale, 0)
    scatter = np.sqrt((offsets**2).sum(axis=1) / np.maximum(placed.sum(axis=1), 1))
    free = np.maximum((trust * seen).sum(axis=1) - basis.shape[-1], 1)
    unit = (trust * seen * errors**2).sum(axis=1) / free
    correlated = np.maximum(len(circles.angles) / _lengths(circles, frames), 1)
    covariance = np.linalg.inv(normal)[:, :2, :2] * (unit * correlated)[:, None, None]
    return changes, Fit(frames, contrast, _median(bright, seen), share, scatter, covariance)


def _basis(circles: Circles, scale: np.ndarray, projective: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return what moves edges, shape (k, m, n), and the prior precision of each unknown."""
    shared = frame.displacement_basis(circles.angles, circles.radii)
    count = len(scale)
    if not projective:
        return np.broadcast_to(shared[:, :5], (count, len(shared), 5)), np.full(5, 1e-6)
    band = np.where(circles.radii > 1, circles.radii, 0)
    columns = [
        np.broadcast_to(shared, (count, *shared.shape)),
        np.broadcast_to(band[:, None], (count, len(band), 1)),
        (-circles.polarity / scale)[..., None],
    ]
    prior = np.full(9, 1e-6)
    prior[5:7], prior[7] = _PRIOR_PERSPECTIVE**-2, _PRIOR_SCALE**-2
    prior[8] = _PRIOR_SHIFT**-2
    return np.concatenate(columns, axis=2), prior


def _least_squares(
    values: np.ndarray, weights: np.ndarray, basis: np.ndarray, prior: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the solutions, shape (k, n), and the normal matrices of k weighted problems."""
    weighted = basis * weights[..., None]
    normal = weighted.transpose(0, 2, 1) @ basis + np.diag(prior)
    right = (weighted * values[..., None]).sum(axis=1)
    return np.linalg.solve(normal, right[..., None])[..., 0], normal


def _median(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the medians over the last axis of the chosen values, 1 where there is none."""
    count = chosen.sum(axis=1)
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[:, None] // 2, axis=1)[:, 0]
    return np.where(count > 0, middle, 1.0)


def _lengths(circles: Circles, frames: np.ndarray) -> np.ndarray:
    """Return the lengths of the circles' edges in the image, px."""
    major, minor, _ = frame.ellipse_axes(frames)
    radii = np.unique(circles.radii)
    return np.sqrt(major * minor) * 2 * np.pi * radii.sum()
