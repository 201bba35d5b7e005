"""Evidence for marks on a target that light cannot easily fake.

A point is marked where it has the colour of the dot, and unmarked where it has that of the ground.
The evidence of a reading is the logarithm of the likelihood of marked over unmarked. The noise of
ln(I + offset) is known from I. A density of what no hypothesis explains, such as an edge of light,
bounds the evidence of one reading.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.imaging.black import black_lift, lifted
from ahf_ros.imaging.logarithm import LOG_OFFSET

NOISE = 1.2
"""Usual noise of gray values from 0 to 255."""

_SURROUND_SPREAD = 0.16  # of ln, of steps where there is no edge
_MARK_SPREAD, _MARK_TAIL = 0.16, 0.35  # of ln, of the step of a mark, and towards more
_BORDER_SPREAD = 0.2  # of steps along the band, in steps of a mark
_BORDER_FLOOR = 0.5  # density of them where an edge of light lies between
_LEVEL_SPREAD = 0.12  # of ln, of levels
_FLOOR = 0.06  # density of what no hypothesis explains
_MAXIMUM = 4.0  # evidence of one reading
_EDGE_STEP = 0.35  # of ln, of an edge of light
_MINIMUM_EDGES, _MAXIMUM_EDGES = 0.02, 0.5  # probability of one between neighbouring points
_MINIMUM_STEP = 0.2  # of ln, of a mark
_DEEPEST_SHADOW = 0.1  # of the light on the dot, elsewhere on the target

LEVEL_BIN = 0.05
"""Distance of two levels, of ln."""

LEVELS = np.arange(np.log(LOG_OFFSET), np.log(255 + LOG_OFFSET) + LEVEL_BIN, LEVEL_BIN)
"""The levels of ln I that densities are of."""

_DISTANCES = LEVEL_BIN * (np.arange(len(LEVELS))[:, None] - np.arange(len(LEVELS)))
_KERNEL = np.exp(-0.5 * (_DISTANCES / _LEVEL_SPREAD) ** 2) / (_LEVEL_SPREAD * np.sqrt(2 * np.pi))


@dataclass(frozen=True, slots=True)
class MarkAppearance(ArrayRecord):
    """How the marks of k targets look on their ground.

    Attributes
    ----------
    polarity : ndarray of int, shape (k,)
        1 where marks are dark, -1 where they are bright.
    contrast : ndarray of float64, shape (k,)
        Gray value of dark over bright under the same light.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side of the dot's edge.
    blur : ndarray of float64, shape (k,)
        Of their edges, standard deviation in px.
    """

    polarity: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray
    blur: np.ndarray

    @property
    def lift(self) -> np.ndarray:
        """Gray values that black is lifted to, see `ahf_ros.imaging.black`."""
        return black_lift(self.contrast, self.bright)

    def lifted(self) -> MarkAppearance:
        """Return how marks look when black is lifted."""
        bright = lifted(self.bright, self.lift)
        dark = lifted(self.contrast * self.bright, self.lift)
        return replace(self, contrast=dark / bright, bright=bright)

    def step(self, values: np.ndarray) -> np.ndarray:
        """Return the step of ln onto a mark where the bright side has gray values (k, ...)."""
        spread = (slice(None),) + (None,) * (values.ndim - 1)
        bright = np.maximum(values, _DEEPEST_SHADOW * self.bright[spread])
        dark = self.contrast[spread] * bright
        return self.polarity[spread] * np.log((dark + LOG_OFFSET) / (bright + LOG_OFFSET))


def log_ratio(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the steps of ln from others to values, both gray values from 0 to 255."""
    return np.log((values + LOG_OFFSET) / (others + LOG_OFFSET))


@dataclass(frozen=True, slots=True)
class LightLevels:
    """The light on k targets, as their bright points show it.

    Attributes
    ----------
    unmarked, marked : ndarray of float64, shape (k, n)
        Densities of n levels of ln I, of unmarked and of marked points.
    edges : ndarray of float64, shape (k,)
        Probability that an edge of light lies between two neighbouring points.
    """

    unmarked: np.ndarray
    marked: np.ndarray
    edges: np.ndarray

    def densities(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the densities of gray values (k, ...) where unmarked and where marked."""
        bins = level_bins(_flat(values))
        tables = (self.unmarked, self.marked)
        unmarked, marked = (
            np.take_along_axis(table, bins, axis=1).reshape(values.shape) for table in tables
        )
        return unmarked, marked


def light_levels(bright: np.ndarray, gap: np.ndarray, marks: MarkAppearance) -> LightLevels:
    """Return the light on targets.

    Bright points show under which light a target lies. The density of their levels is that of all
    its bright parts. Shifted by the step of a mark, it is that of the dark parts.

    Parameters
    ----------
    bright : ndarray of float, shape (k, ...)
        Gray values of bright points: the ground of dark marks, or a bright dot.
    gap : ndarray of float, shape (2, k, m)
        Gray values on two circles in the gap.
    marks : MarkAppearance
    """
    seen = level_bins(_flat(bright))
    levels = np.broadcast_to(np.exp(LEVELS) - LOG_OFFSET, (len(seen), len(LEVELS)))
    moved = LEVELS - np.abs(marks.step(levels)) - LEVELS[0]
    moved = np.clip(np.rint(moved / LEVEL_BIN).astype(np.intp), 0, len(LEVELS) - 1)
    dark, light = _density(np.take_along_axis(moved, seen, axis=1)), _density(seen)
    of_dark_marks = (marks.polarity > 0)[:, None]
    edges = (np.abs(log_ratio(gap[1], gap[0])) > _EDGE_STEP).mean(axis=1)
    return LightLevels(
        np.where(of_dark_marks, light, dark),
        np.where(of_dark_marks, dark, light),
        np.clip(edges, _MINIMUM_EDGES, _MAXIMUM_EDGES),
    )


def step_evidence(
    surround: np.ndarray, values: np.ndarray, marks: MarkAppearance, light: LightLevels
) -> np.ndarray:
    """Return the evidence that a step from the surround leads onto a mark.

    Either the light is the same on both sides, and the step is zero or that of a mark. Or an edge
    of light lies between them, and any level of the light may follow.
    """
    step = log_ratio(values, surround)
    noise = NOISE * np.hypot(1 / (values + LOG_OFFSET), 1 / (surround + LOG_OFFSET))
    unmarked = normal_density(step, np.hypot(_SURROUND_SPREAD, noise))
    marked = mark_step_density(step, np.maximum(values, surround), marks, noise)
    edges = light.edges[:, None]
    other_unmarked, other_marked = light.densities(values)
    marked = (1 - edges) * marked + edges * other_marked
    unmarked = (1 - edges) * unmarked + edges * other_unmarked
    return _limited(marked, unmarked)


def mark_step_density(
    step: np.ndarray, bright: np.ndarray, marks: MarkAppearance, noise: np.ndarray
) -> np.ndarray:
    """Return the densities of steps of ln I that lead onto a mark.

    Parameters
    ----------
    step : ndarray of float, shape (k, ...)
    bright : ndarray of float, shape (k, ...)
        Gray values of the bright side.
    marks : MarkAppearance
    noise : ndarray of float, shape (k, ...)
        Of the steps.
    """
    expected = marks.step(bright)
    error = (step - expected) * np.sign(expected)
    spread, tail = np.hypot(_MARK_SPREAD, noise), np.hypot(_MARK_TAIL, noise)
    width = np.where(error > 0, tail, spread)
    density: np.ndarray = normal_density(error, width) * width / ((spread + tail) / 2)
    return density


def level_evidence(values: np.ndarray, light: LightLevels) -> np.ndarray:
    """Return the evidence of the gray values of the band, by the light on the target."""
    unmarked, marked = light.densities(np.moveaxis(values, 0, 2))
    return _limited(marked, unmarked).mean(axis=2)


def _limited(marked: np.ndarray, unmarked: np.ndarray) -> np.ndarray:
    evidence = np.log((marked + _FLOOR) / (unmarked + _FLOOR))
    return np.clip(evidence, -_MAXIMUM, _MAXIMUM)


def _flat(values: np.ndarray) -> np.ndarray:
    """Return values of shape (k, ...) as (k, m), also where k is 0."""
    return values.reshape(len(values), int(np.prod(values.shape[1:])))


def level_bins(values: np.ndarray) -> np.ndarray:
    """Return the bins of gray values among `LEVELS`."""
    bins = np.rint((np.log(np.maximum(values, 0) + LOG_OFFSET) - LEVELS[0]) / LEVEL_BIN)
    return np.clip(bins.astype(np.intp), 0, len(LEVELS) - 1)


def _density(bins: np.ndarray) -> np.ndarray:
    """Return the smoothed densities of k sets of bins, shape (k, number of levels)."""
    size = len(LEVELS)
    keys = (bins + size * np.arange(len(bins))[:, None]).ravel()
    counts = np.bincount(keys, minlength=size * len(bins)).reshape(len(bins), size)
    return counts / max(bins.shape[1], 1) @ _KERNEL


def border_evidence(
    band: np.ndarray, marks: MarkAppearance, light: LightLevels
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence of borders onto a mark and off it, against none, after each angle."""
    before, after = np.roll(band, 1, axis=2), np.roll(band, -2, axis=2)
    bright = np.moveaxis(np.maximum(before, after), 0, 2)
    mark = np.moveaxis(marks.step(bright), 2, 0)
    # The step of a mark without contrast tells nothing.
    mark = np.copysign(np.maximum(np.abs(mark), _MINIMUM_STEP), mark)
    rise = log_ratio(after, before) / mark
    floor = _FLOOR + _BORDER_FLOOR * light.edges[:, None]
    onto, none, off = (
        np.log(normal_density(rise - height, _BORDER_SPREAD) + floor) for height in (1, 0, -1)
    )
    return (onto - none).sum(axis=0), (off - none).sum(axis=0)


def normal_density(values: np.ndarray, spread: np.ndarray | float) -> np.ndarray:
    """Return the densities of values under a normal distribution about 0."""
    return np.exp(-0.5 * (values / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
