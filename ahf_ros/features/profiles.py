"""Edges measured in gray values, on profiles across the outlines of targets.

Across each point of an outline a blurred step is fitted to the gray values. Besides the offset of
the step, the fit gives its levels, the slope of the light beside it and what it leaves
unexplained, which tell later how much weight the edge deserves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import erf, pi, sqrt

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.circles import Circles
from ahf_ros.features.sampling import sample_lines, within

USUAL_BLUR = 0.8
"""Standard deviation of a step, px: a sharp lens, the area of a pixel and the interpolation."""

BLURS = (0.5, 2.0)
"""Sharpest and softest step that is fitted, standard deviation in px."""

CORRELATION = 1.9
"""Distance along an edge from where on the errors of profiles are independent, px."""

_HALF_WIDTHS = np.array([0.0, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0])  # of a profile, px
_SAMPLES = 13  # of a profile
_FARTHEST, _SPACING = 0.8, 0.1  # of the offsets that are tried, half widths of a profile
_MAXIMUM_ASIDE = 0.8  # of the two lines of a profile, from its middle, px
_BLUR_STEP = 0.1
_CONTRAST = 0.25  # usual gray value of dark over bright
_MINIMUM_STEP = 1.0  # gray values, that an offset is computed from


@dataclass(frozen=True, slots=True)
class OutlinePoints:
    """Where the outlines of k targets have edges, at m points each.

    Attributes
    ----------
    points, normals : ndarray of float64, shape (k, m, 2)
        In px; normals point outwards and have the length 1.
    polarity : ndarray of int, shape (k, m)
        1 where the outside is brighter, -1 where it is darker, 0 where there is no edge.
    scale : ndarray of float64, shape (k, m)
        px a unit of the outline (the dot radius of a ring target), across the edge.
    spacing : ndarray of float64, shape (k, m)
        Distance from one point to the next along the edge, px.
    curvature : ndarray of float64, shape (k, m)
        Of the outline, 1/px, positive where its centre lies inside.
    """

    points: np.ndarray
    normals: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    spacing: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of k targets at m points each, shape (k, m) all.

    Attributes
    ----------
    offset : ndarray of float64
        Distance of the edge from the outline, outwards, px.
    dark, bright : ndarray of float64
        Gray values beside it.
    slope : ndarray of float64
        Slope of the light outwards, as a share of it, 1/px.
    sensitivity : ndarray of float64
        How far a slope of the light moves the offset outwards, px^2.
    softness : ndarray of float64
        Blur of the edge less that of the step, standard deviations in px.
    residual : ndarray of float64
        Root mean square of what step, slope and blur do not explain, gray values.
    scale : ndarray of float64
        As in `OutlinePoints`, as is the next.
    spacing : ndarray of float64
    visible : ndarray of bool
        Whether an edge is expected and its profile lies in the image; what was measured is 0
        elsewhere.
    """

    offset: np.ndarray
    dark: np.ndarray
    bright: np.ndarray
    slope: np.ndarray
    sensitivity: np.ndarray
    softness: np.ndarray
    residual: np.ndarray
    scale: np.ndarray
    spacing: np.ndarray
    visible: np.ndarray


def measure_edges(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    blur: np.ndarray,
    reach: float | np.ndarray,
) -> Edges:
    """Fit blurred steps to the gray values across circles.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
    circles : Circles
    blur : ndarray of float64, shape (k,)
        Standard deviation of the steps, px. A wrong one costs precision, and moves nothing.
    reach : float or ndarray of float, shape (k, 1)
        How far from a circle to look, dot radii.
    """
    circle = frame.circle_geometry(frames, circles.angles, circles.radii)
    points = OutlinePoints(
        circle.points,
        circle.normals,
        circles.polarity,
        circle.scale,
        circles.spacing * circle.stretch,
        circle.curvature,
    )
    return measure_outlines(gray, points, blur, reach)


def measure_outlines(
    gray: np.ndarray, outlines: OutlinePoints, blur: np.ndarray, reach: float | np.ndarray
) -> Edges:
    """Fit blurred steps to the gray values across the outlines of k targets.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    outlines : OutlinePoints
    blur : ndarray of float64, shape (k,)
        Standard deviation of the steps, px. A wrong one costs precision, and moves nothing.
    reach : float or ndarray of float, shape (k, 1)
        How far from an outline to look, in its units.
    """
    aside = np.minimum(outlines.spacing / 4, _MAXIMUM_ASIDE)
    which = np.searchsorted(_HALF_WIDTHS, reach * outlines.scale, side='right') - 1
    which[outlines.polarity == 0] = 0
    ends = _HALF_WIDTHS[which, None] * outlines.normals
    for end in (outlines.points - ends, outlines.points + ends):
        which[~within(end, gray.shape)] = 0
    blurs = np.rint(np.clip(blur, *BLURS) / _BLUR_STEP).astype(int)
    groups = np.where(which > 0, which + len(_HALF_WIDTHS) * blurs[:, None], 0)
    steps = np.zeros((7, *which.shape))
    for group in np.unique(groups[groups > 0]):
        blur_steps, index = divmod(int(group), len(_HALF_WIDTHS))
        half = float(_HALF_WIDTHS[index])
        selected = np.nonzero(groups == group)
        polarity = outlines.polarity[selected]
        across = polarity[:, None] * outlines.normals[selected]  # from dark to bright
        values = _profiles(gray, outlines.points[selected], across, aside[selected], half)
        fitted = _fit_steps(values, _step_filters(half, blur_steps * _BLUR_STEP))
        fitted[[0, 3]] *= polarity
        steps[:, selected[0], selected[1]] = fitted
    # On a curve, the blur and the chord between the two lines of a profile lie inside.
    inside = (blur[:, None] ** 2 + aside**2) / 2 * outlines.curvature
    steps[0] += np.where(which > 0, inside, 0.0)
    offset, dark, bright, slope, sensitivity, softness, residual = steps
    return Edges(
        offset,
        dark,
        bright,
        slope,
        sensitivity,
        softness,
        residual,
        outlines.scale,
        outlines.spacing,
        which > 0,
    )


def _profiles(
    gray: np.ndarray, points: np.ndarray, across: np.ndarray, aside: np.ndarray, half: float
) -> np.ndarray:
    """Return profiles through n points, each the mean of two lines, shape (n, samples)."""
    along = np.linspace(-half, half, _SAMPLES)
    beside = aside[:, None] * across[:, ::-1] * [-1, 1]
    first, second = (
        sample_lines(gray, middles, across, along)
        for middles in (points - beside, points + beside)
    )
    return (first + second) / 2


def _fit_steps(values: np.ndarray, filters: _StepFilters) -> np.ndarray:
    """Fit blurred steps to n profiles, shape (n, samples), from dark to bright.

    The fit is linear about each of the offsets tried; the one with the smallest residual is taken.

    Returns
    -------
    ndarray of float64, shape (7, n)
        Offset, levels before and after, slope of the light, how a slope moves the offset, missing
        blur, and residual.
    """
    count = len(filters.offsets)
    first, second, contrast = (
        (values @ filters.search).reshape(len(values), 3, count).swapaxes(0, 1)
    )
    explained = np.where(contrast > 0, first * first + second * second, -1.0)
    best = explained.argmax(axis=1)
    parameters = np.empty((len(values), filters.parts.shape[2]), np.float32)
    for index in np.unique(best):
        there = best == index
        parameters[there] = values[there] @ filters.parts[index]
    low, high, moved, light, blurred = parameters[:, :5].T.astype(np.float64)
    residual = np.sqrt((parameters[:, 5:] ** 2).mean(axis=1))
    contrast = np.maximum(high - low, _MINIMUM_STEP)
    spacing = filters.offsets[1] - filters.offsets[0]
    offset = filters.offsets[best] + np.clip(-moved / contrast, -spacing, spacing)
    slope, softness = light / np.maximum(high, _MINIMUM_STEP), -blurred / contrast
    return np.stack([offset, low, high, slope, filters.sensitivity[best], softness, residual])


@dataclass(frozen=True, slots=True)
class _StepFilters:
    offsets: np.ndarray  # (p,), tried, px
    search: np.ndarray  # (samples, 3 p), two that explain a step at each, and its contrast
    parts: np.ndarray  # (p, samples, 5 + samples), low, high, moved, slope, blur, residuals
    sensitivity: np.ndarray  # (p,), how a slope of the light of 1 / px moves a step, px^2


@cache
def _step_filters(half: float, blur: float) -> _StepFilters:
    """Return the filters that fit steps of a blur to profiles of a half width.

    A step has the levels inside and outside, and minus its contrast times its distance from the
    offset as unknowns; the slope of the light is one more, and minus its contrast times its change
    of blur another. A single profile hardly determines these two: each is fitted with those
    before it, and without those behind.
    """
    along = np.linspace(-half, half, _SAMPLES)
    offsets = np.arange(-_FARTHEST * half, _FARTHEST * half + 1e-9, _SPACING * half)
    search, parts, sensitivity = [], [], []
    for offset in offsets:
        scaled = (along - offset) / blur
        rise = 0.5 * (1 + np.array([erf(value / sqrt(2)) for value in scaled]))
        density = np.exp(-0.5 * scaled**2) / (blur * sqrt(2 * pi))
        light = (along - offset) * (_CONTRAST + (1 - _CONTRAST) * rise)
        design = np.stack([1 - rise, rise, density, light, scaled * density], axis=1)
        step = np.linalg.pinv(design[:, :3])
        slope = np.linalg.pinv(design[:, :4])[3]
        softness = np.linalg.pinv(design)[4]
        basis = np.linalg.qr(design)[0]
        rest = np.eye(_SAMPLES) - basis @ basis.T
        search.append([*np.linalg.qr(design[:, :2])[0].T, step[1] - step[0]])
        parts.append(np.column_stack([step.T, slope, softness, rest]))
        sensitivity.append(-(light @ step[2]) / (1 - _CONTRAST))
    return _StepFilters(
        offsets,
        np.array(search).transpose(2, 1, 0).reshape(_SAMPLES, -1).astype(np.float32),
        np.array(parts, np.float32),
        np.array(sensitivity),
    )
