"""Blurred steps fitted to profiles of gray values.

The fit is linear about each of a few offsets, so that it is done by filters that are made once for
each blur and each width of profiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import erf, pi, sqrt

import numpy as np

SAMPLES = 13
"""Number of samples of a profile."""

ALONG = np.linspace(-1, 1, SAMPLES)
"""Where they are, half widths of the profile."""

HALF_WIDTHS = np.array([0.0, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])
"""Half widths of profiles, px; the first one stands for no profile."""

BLUR_STEP = 0.1
"""Distance of two blurs that filters are made for, standard deviations in px."""

_FARTHEST, _OFFSETS = 0.8, 17  # farthest offset that is tried, half widths, and number of them
_CONTRAST = 0.25  # usual gray value of dark over bright
_MINIMUM_STEP = 1.0  # gray values, that an offset is computed from


def fit_steps(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Fit blurred steps to n profiles, shape (n, samples), from dark to bright.

    The fit is linear about each of the offsets tried; the one with the smallest residual is taken.

    Parameters
    ----------
    values : ndarray of float32, shape (n, samples)
    groups : ndarray of int, shape (n,)
        Ascending; index of the half width, plus index of the blur times the count of half widths.

    Returns
    -------
    ndarray of float64, shape (7, n)
        Offset, levels before and after, slope of the light, how a slope moves the offset, missing
        blur, and residual.
    """
    best = np.empty(len(values), np.intp)
    bounds = np.flatnonzero(np.diff(groups, prepend=-1, append=-1))
    for start, end in pairwise(bounds):
        best[start:end] = _best_offsets(values[start:end], _filters_of(groups[start]))
    kinds = groups * _OFFSETS + best
    order = np.argsort(kinds, kind='stable')
    ordered, kinds = values[order], kinds[order]
    parameters = np.empty((len(values), SAMPLES), np.float32)
    known = np.empty((3, len(values)))
    bounds = np.flatnonzero(np.diff(kinds, prepend=-1, append=-1))
    for start, end in pairwise(bounds):
        group, index = divmod(int(kinds[start]), _OFFSETS)
        filters = _filters_of(group)
        np.matmul(ordered[start:end], filters.parts[index], out=parameters[start:end])
        known[:, start:end] = filters.known[:, index, None]
    low, high, moved, light, blurred = parameters[:, :5].T.astype(np.float64)
    rest = parameters[:, 5:]
    residual = np.sqrt(np.einsum('ij,ij->i', rest, rest) / values.shape[1])
    tried, spacing, sensitivity = known
    contrast = np.maximum(high - low, _MINIMUM_STEP)
    offset = tried + np.clip(-moved / contrast, -spacing, spacing)
    slope, softness = light / np.maximum(high, _MINIMUM_STEP), -blurred / contrast
    fitted = np.empty((7, len(values)))
    for row, of in zip(
        fitted, (offset, low, high, slope, sensitivity, softness, residual), strict=True
    ):
        row[order] = of
    return fitted


def _best_offsets(values: np.ndarray, filters: _StepFilters) -> np.ndarray:
    """Return the indices of the offsets at which steps explain profiles best."""
    found = values @ filters.search
    first, second, contrast = (
        found[:, index * _OFFSETS : (index + 1) * _OFFSETS] for index in range(3)
    )
    first *= first
    second *= second
    first += second
    np.copyto(first, -1.0, where=contrast <= 0)
    best: np.ndarray = first.argmax(axis=1)
    return best


@dataclass(frozen=True, slots=True)
class _StepFilters:
    search: np.ndarray  # (samples, 3 p), two that explain a step at each offset, its contrast
    parts: np.ndarray  # (p, samples, samples), low, high, moved, slope, blur, residuals
    known: np.ndarray  # (3, p), offsets, their spacing, how a slope of the light moves steps, px^2


def _filters_of(group: int) -> _StepFilters:
    """Return the filters of a group, see `fit_steps`."""
    blur_steps, index = divmod(int(group), len(HALF_WIDTHS))
    return _step_filters(float(HALF_WIDTHS[index]), blur_steps * BLUR_STEP)


@cache
def _step_filters(half: float, blur: float) -> _StepFilters:
    """Return the filters that fit steps of a blur to profiles of a half width.

    A step has the levels inside and outside, and minus its contrast times its distance from the
    offset as unknowns; the slope of the light is one more, and minus its contrast times its change
    of blur another. A single profile hardly determines these two: each is fitted with those
    before it, and without those behind.
    """
    along = half * ALONG
    offsets = half * np.linspace(-_FARTHEST, _FARTHEST, _OFFSETS)
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
        rest = np.linalg.qr(design, mode='complete')[0][:, design.shape[1] :]
        search.append([*np.linalg.qr(design[:, :2])[0].T, step[1] - step[0]])
        parts.append(np.column_stack([step.T, slope, softness, rest]))
        sensitivity.append(-(light @ step[2]) / (1 - _CONTRAST))
    return _StepFilters(
        np.array(search).transpose(2, 1, 0).reshape(SAMPLES, -1).astype(np.float32),
        np.array(parts, np.float32),
        np.stack([offsets, np.full(_OFFSETS, offsets[1] - offsets[0]), sensitivity]),
    )
