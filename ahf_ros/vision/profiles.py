"""Edges measured in gray values, on profiles across the outlines of targets.

Across each point of an outline a blurred step is fitted to the gray values. Besides the offset of
the step, the fit gives its levels, the slope of the light beside it and what it leaves
unexplained, which tell later how much weight the edge deserves. The fit is linear about each of a
few offsets, so that it is done by filters that are made once for each blur and each width of
profiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import pi, sqrt

import numpy as np

from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.sampling import sample_lines, within

USUAL_BLUR = 0.8
"""Standard deviation of a step, px: a sharp lens, the area of a pixel and the interpolation."""

BLURS = (0.5, 4.0)
"""Sharpest and softest step that is fitted, standard deviation in px."""

CORRELATION = 1.9
"""Distance along an edge from where on the errors of profiles are independent, px."""

_SAMPLES = 13  # of a profile
_ALONG = np.linspace(-1, 1, _SAMPLES)  # where they are, half widths
# The first one stands for no profile.
_HALF_WIDTHS = np.array([0.0, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])  # px
_BLUR_STEP = 0.1  # distance of two blurs that filters are made for, standard deviations in px
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
    aside = np.minimum(outlines.spacing / 4, _MAXIMUM_ASIDE)
    enough = np.maximum(_ENOUGH, _ENOUGH_BLURS * blur)[:, None]
    which = np.searchsorted(_HALF_WIDTHS, np.minimum(reach * outlines.scale, enough), 'right') - 1
    which[outlines.polarity == 0] = 0
    ends = _HALF_WIDTHS[which, None] * outlines.normals
    for end in (outlines.points - ends, outlines.points + ends):
        which[~within(end, gray.shape)] = 0
    blurs = np.rint(np.clip(blur, *BLURS) / _BLUR_STEP).astype(int)
    groups = (which + len(_HALF_WIDTHS) * blurs[:, None]).ravel()
    chosen = np.flatnonzero(which)
    chosen = chosen[np.argsort(groups[chosen], kind='stable')]
    points, normals = (of.reshape(-1, 2)[chosen] for of in (outlines.points, outlines.normals))
    outwards = outlines.polarity.ravel()[chosen]
    across = outwards[:, None] * normals  # from dark to bright
    beside = aside.ravel()[chosen, None] * across[:, ::-1] * [-1, 1]
    middles = np.concatenate([points - beside, points + beside])
    directions = _HALF_WIDTHS[which.ravel()[chosen], None] * across
    lines = sample_lines(gray, middles, np.concatenate([directions] * 2), _ALONG)
    profiles = lines[: len(points)] + lines[len(points) :]
    profiles /= 2
    fitted = _fit_steps(profiles, groups[chosen])
    fitted[[0, 3]] *= outwards
    steps = np.zeros((len(fitted), which.size))
    steps[:, chosen] = fitted
    # On a curve, the blur and the chord between the two lines of a profile lie inside.
    inside = (blur[:, None] ** 2 + aside**2) / 2 * outlines.curvature
    steps[0] += np.where(which > 0, inside, 0.0).ravel()
    measured = steps.reshape(len(steps), *which.shape)
    return Edges(*[*measured, outlines.scale, outlines.spacing, which > 0])


def _fit_steps(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Fit blurred steps to n profiles, shape (n, samples), from dark to bright.

    The fit is linear about each of the offsets tried; the one with the smallest residual is taken.
    `groups`, shape (n,), ascend, see `_step_filters`. The result, shape (7, n), has the fields of
    `Edges` up to the residual.
    """
    found = np.empty((len(values), 3 * _OFFSETS), np.float32)
    for some, group in _runs(groups):
        np.matmul(values[some], _step_filters(group).search, out=found[some])
    kinds = groups * _OFFSETS + _best_offsets(found)
    order = np.argsort(kinds, kind='stable')
    ordered, kinds = values[order], kinds[order]
    parameters = np.empty((len(values), 5 + _SAMPLES), np.float32)
    known = np.empty((3, len(values)))
    for some, kind in _runs(kinds):
        filters, index = _step_filters(kind // _OFFSETS), kind % _OFFSETS
        np.matmul(ordered[some], filters.parts[index], out=parameters[some])
        known[:, some] = filters.known[:, index, None]
    low, high, moved, light, blurred = parameters[:, :5].T.astype(np.float64)
    rest = parameters[:, 5:]
    residual = np.sqrt(np.einsum('ij,ij->i', rest, rest) / values.shape[1])
    tried, spacing, sensitivity = known
    contrast = np.maximum(high - low, _MINIMUM_STEP)
    offset = tried + np.clip(-moved / contrast, -spacing, spacing)
    slope, softness = light / np.maximum(high, _MINIMUM_STEP), -blurred / contrast
    fitted = np.empty((7, len(values)))
    fitted[:, order] = offset, low, high, slope, sensitivity, softness, residual
    return fitted


@dataclass(frozen=True, slots=True)
class _StepFilters:
    search: np.ndarray  # (samples, 3 p), two that explain a step at each offset, its contrast
    parts: np.ndarray  # (p, samples, 5 + samples), low, high, moved, slope, blur, residuals
    known: np.ndarray  # (3, p), offsets, their spacing, how a slope of the light moves steps, px^2


def _runs(values: np.ndarray) -> list[tuple[slice, int]]:
    """Return the runs of equal integers among ascending ones, shape (n,), and these integers."""
    starts = np.flatnonzero(values[1:] != values[:-1]) + 1
    bounds = [0, *starts.tolist(), len(values)] if len(values) else []
    return [(slice(start, end), int(values[start])) for start, end in pairwise(bounds)]


def _best_offsets(found: np.ndarray) -> np.ndarray:
    """Return the indices of the offsets at which steps explain n profiles best.

    What the filters of the search found has the shape (n, 3 p).
    """
    first, second, contrast = found.reshape(len(found), 3, _OFFSETS).swapaxes(0, 1)
    first *= first
    second *= second
    first += second
    np.copyto(first, -1.0, where=contrast <= 0)
    return first.argmax(axis=1)


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
