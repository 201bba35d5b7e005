"""Edges measured in gray values, on profiles across the outlines of targets.

Across each point of an outline a blurred step is fitted to the gray values. Besides the offset of
the step, the fit gives its levels, the slope of the light beside it and what it leaves
unexplained, which tell later how much weight the edge deserves. The fit is linear about each of a
few offsets, of which the one with the smallest residual is taken; so it is done by filters that
are made once for each blur and each width of profiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.normal import normal_integral

USUAL_BLUR = 0.8
"""Standard deviation of a step, px: a sharp lens, the area of a pixel and the interpolation."""

BLURS = (0.5, 4.0)
"""Sharpest and softest step that is fitted, standard deviation in px."""
SOFTEST = 3.0
"""Blur from which profiles may be too short, px; a half of the image has half of it.

In a profile that is shorter than the blur, noise looks like an edge.
"""

CORRELATION = 1.9
"""Distance along an edge from where on the errors of profiles are independent, px."""

_SAMPLES = 13  # of a profile
_ALONG = np.linspace(-1, 1, _SAMPLES)  # where they are, half widths
# The first one stands for no profile.
_HALF_WIDTHS = np.array([0.0, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])  # px
_BLUR_STEP, _BLURS = 0.1, 41  # of blurs that filters are made for, px, and number of them, from 0
_ENOUGH, _ENOUGH_BLURS = 3.0, 2.5  # half width of a profile, px, or deviations of the step
_MAXIMUM_ASIDE = 0.8  # of the two lines of a profile, from its middle, px
_MAXIMUM_OFFSET, _OFFSETS = 0.8, 17  # that is tried, half widths, and number of them
_CONTRAST = 0.25  # usual gray value of dark over bright
_MINIMUM_STEP = 1.0  # gray values, that an offset is computed from


@dataclass(frozen=True, slots=True)
class OutlinePoints:
    """Where the outlines of k targets have edges, at m points each, px."""

    points: np.ndarray  # (k, m, 2)
    normals: np.ndarray  # (k, m, 2), outwards, of length 1
    polarity: np.ndarray  # (k, m), 1 where the outside is brighter, -1 darker, 0 for no edge
    scale: np.ndarray  # (k, m), px a unit of the outline (a dot radius, say), across the edge
    spacing: np.ndarray  # (k, m), distance from one point to the next along the edge
    curvature: np.ndarray  # (k, m), of the outline, 1/px, positive where its centre lies inside


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of k targets at m points each, shape (k, m) all; 0 where none is visible."""

    offset: np.ndarray  # distance from the outline, outwards, px
    dark: np.ndarray  # gray values beside it
    bright: np.ndarray
    slope: np.ndarray  # of the light outwards, as a share of it, 1/px
    sensitivity: np.ndarray  # how far a slope of the light moves the offset outwards, px^2
    softness: np.ndarray  # blur of the edge minus that of the step, standard deviations in px
    residual: np.ndarray  # root mean square of what step, slope and blur do not explain
    scale: np.ndarray  # as in `OutlinePoints`, everywhere
    spacing: np.ndarray
    visible: np.ndarray  # whether an edge is expected and its profile lies in the image


def measure_outlines(
    gray: np.ndarray, outlines: OutlinePoints, blur: np.ndarray, reach: float | np.ndarray
) -> Edges:
    """Fit blurred steps to gray values, float32 from 0 to 255, across the outlines of k targets.

    The standard deviations of the steps, `blur`, are px of shape (k,); a wrong one costs
    precision, and moves nothing. Steps are looked for within `reach` of an outline, in its units,
    a number or of shape (k, 1).
    """
    width, height = gray.shape[::-1]
    reach = np.broadcast_to(np.ravel(reach), len(blur))
    enough = np.maximum(_ENOUGH, _ENOUGH_BLURS * blur)
    blurs = np.rint(np.clip(blur, *BLURS) / _BLUR_STEP).astype(int)
    at = outlines.points, outlines.normals, outlines.polarity
    of_width = reach, enough, blurs, _HALF_WIDTHS
    groups = kernels.profile_groups(*at, outlines.scale, *of_width, width - 1.0, height - 1.0)
    chosen = np.flatnonzero(np.bincount(groups.ravel()))
    chosen = chosen[chosen % len(_HALF_WIDTHS) > 0]
    filters = np.full(_BLURS * len(_HALF_WIDTHS), -1)
    filters[chosen] = np.arange(len(chosen))
    search, parts, known = _step_filters_of(chosen.tolist())
    of_curve = outlines.spacing, outlines.curvature, blur
    of_steps = np.tile(_HALF_WIDTHS, _BLURS), filters, _ALONG, search, parts, known
    *measured, visible = kernels.fit_steps(
        gray, *at, *of_curve, groups, *of_steps, _MAXIMUM_ASIDE, _MINIMUM_STEP
    )
    return Edges(*[*measured, outlines.scale, outlines.spacing, visible])


class _StepFilters(NamedTuple):
    search: np.ndarray  # (samples, 3 p), two that explain a step at each offset, its contrast
    parts: np.ndarray  # (p, samples, 5 + samples), low, high, moved, slope, blur, residuals
    known: np.ndarray  # (3, p), offsets, their spacing, how a slope of the light moves steps, px^2


def _step_filters_of(groups: list[int]) -> list[np.ndarray]:
    """Return the filters of each group, one after the other."""
    of_groups = [*map(_step_filters, groups)]
    sides = (_SAMPLES, 3 * _OFFSETS), (_OFFSETS, _SAMPLES, 5 + _SAMPLES), (3, _OFFSETS)
    parts = zip(*of_groups, strict=True) if groups else [()] * 3
    return [np.array(of).reshape(-1, *shape) for of, shape in zip(parts, sides, strict=True)]


@cache
def _step_filters(group: int) -> _StepFilters:
    """Return the filters that fit steps of one blur to profiles of one half width.

    A group is the index of the half width, plus the blur in steps times their number. A step has
    the levels inside and outside, and minus its contrast times its distance from the
    offset as unknowns; the slope of the light is one more, and minus its contrast times its change
    of blur another. A single profile hardly determines these two: each is fitted with those
    before it, and without those behind.
    """
    blur_steps, index = divmod(group, len(_HALF_WIDTHS))
    half, blur = float(_HALF_WIDTHS[index]), blur_steps * _BLUR_STEP
    along = half * _ALONG
    offsets = half * np.linspace(-_MAXIMUM_OFFSET, _MAXIMUM_OFFSET, _OFFSETS)
    away = along - offsets[:, None]
    scaled = away / blur
    rise = normal_integral(scaled)
    density = np.exp(-0.5 * scaled**2) / (blur * sqrt(2 * pi))
    light = away * (_CONTRAST + (1 - _CONTRAST) * rise)
    design = np.stack([1 - rise, rise, density, light, scaled * density], axis=2)
    step, whole = np.linalg.pinv(design[..., :3]), np.linalg.pinv(design)
    slope, softness = np.linalg.pinv(design[..., :4])[:, 3:], whole[:, 4:]
    rest = np.eye(_SAMPLES) - design @ whole
    first = design[..., 0] / np.sqrt((design[..., 0] ** 2).sum(axis=1, keepdims=True))
    second = rise - (first * rise).sum(axis=1, keepdims=True) * first
    second /= np.sqrt((second**2).sum(axis=1, keepdims=True))
    bases = np.stack([first, second], axis=1)
    search = np.concatenate([bases, step[:, 1:2] - step[:, :1]], axis=1)
    parts = np.concatenate([step, slope, softness, rest], axis=1).swapaxes(1, 2)
    sensitivity = -(light * step[:, 2]).sum(axis=1) / (1 - _CONTRAST)
    return _StepFilters(
        search.transpose(2, 1, 0).reshape(_SAMPLES, -1).astype(np.float32),
        np.ascontiguousarray(parts, np.float32),
        np.stack([offsets, np.full(_OFFSETS, offsets[1] - offsets[0]), sensitivity]),
    )
