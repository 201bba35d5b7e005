"""Evidence of the samples of a band, at every angle, for ground, for a mark, and for neither.

Four kinds of readings are weighed:

- ground: gap and margin, against the light on the target; something before them is neither;
- edges: the step across the inner and the outer edge of the band, against the step that a mark
  makes at the gray value beside it, and where between its two sides it lies;
- levels: the gray values in the band, against those of ground and marks under the light;
- borders: the step along the band where two sectors meet, and its absence within them.

The inner half of the band and the outer half are weighed apart, because what hides one may leave
the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_evidence import CORRELATION, MINIMUM_ALONG, BandEvidence
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.evidence import (
    NOISE,
    MarkAppearance,
    level_bins,
    log_ratio,
    mark_step_density,
    normal_density,
)
from ahf_ros.detectors.ring.light import Light, seen_light
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.frame import mean_radii
from ahf_ros.imaging.logarithm import LOG_OFFSET

_FLOOR = 0.06  # density of what no hypothesis explains
_GROUND_FLOOR = 0.03  # the same, of gap and margin
_GROUND_WEIGHT = 0.4  # of a reading of them, many of which are alike
_ANYTHING = 0.29  # density of levels of ln I where anything may lie
_LIKE_GROUND = 0.3  # probability that what hides a band is as bright as its ground
_ANY_STEP = 0.25  # density of steps of ln where anything may lie
_PLAIN = 0.5  # probability that what hides a band has no edge there
_SATURATED = 253.0  # gray value
_SATURATION = 2.0  # evidence of a saturated reading for glare
_WHITE_OUT = (0.7, 0.9)  # share of the ground that is saturated, where it begins to be no glare
_MIDDLE, _MIDDLE_SPREAD = 0.57, 0.17  # level on an edge, as a share of its step up
_ANY_MIDDLE = 0.6  # density of it where anything may lie
_MISPLACED = 0.015  # probability that an edge of a mark is not where it should be
_MIDDLE_RANGE = (-4.2, 1.0)
_MIDDLE_STEP = 0.3  # of ln, of a step whose place can be told
_EVEN = 4  # exponent of the probability that no edge of light lies near
_MINIMUM_EDGES = 0.02
_INKED, _INK_DENSITY = 3.0, 0.3  # times the density of ground, and density, of what may be ink


@dataclass(frozen=True, slots=True)
class PrintEvidence(ArrayRecord):
    """Evidence about the bands of k targets at m angles, in units of ln, weighted.

    Attributes
    ----------
    halves : ndarray of float64, shape (k, 2, 2, m)
        Of ground and of a mark, over anything else, in the inner and the outer half of the band.
    free : ndarray of float64, shape (k, 2, m)
        Of the ground beside the inner half and beside the outer one, which is part of these.
    inked : ndarray of bool, shape (k, 2, m)
        Whether something as dark as ink (as bright, for bright marks) lies on the ground beside
        the inner and the outer edge of the band.
    onto, off : ndarray of float64, shape (k, m)
        For a border onto a mark and off it, against none, after each angle.
    edges : ndarray of float64, shape (k,)
        Probability of an edge of light between two neighbouring points.
    uneven : ndarray of float64, shape (k,)
        Usual deviation of the light on the ground, of ln.
    """

    halves: np.ndarray
    free: np.ndarray
    inked: np.ndarray
    onto: np.ndarray
    off: np.ndarray
    edges: np.ndarray
    uneven: np.ndarray


def print_evidence(
    samples: BandSamples,
    evidence: BandEvidence,
    marks: MarkAppearance,
    frames: np.ndarray,
    family: Family,
) -> PrintEvidence:
    """Weigh the samples of bands.

    Parameters
    ----------
    samples : BandSamples
        Of k targets.
    evidence : BandEvidence
        Of these samples.
    marks : MarkAppearance
    frames : ndarray of float64, shape (k, 3, 3)
        Of the targets.
    family : Family
    """
    along = 2 * np.pi * family.band_inner * mean_radii(frames) / samples.visible.shape[2]
    noise = _noise(samples.gap, along)
    light = seen_light(samples, marks, evidence.edges, noise)
    tables = _Tables(light)
    grounds = [(*samples.gap, samples.inner_ground), (samples.outer_ground,)]
    glare = _glare(samples)
    band = samples.band
    halves, free = [], []
    for half, (readings, levels) in enumerate(
        zip(grounds, ((band[0], band[1]), (band[2], band[1])), strict=True)
    ):
        on_ground = _GROUND_WEIGHT * sum(tables.on_ground(of) for of in readings)
        on_ground -= glare * sum(of >= _SATURATED for of in readings) / len(readings)
        steps = _steps(*samples.edges[half], samples.on_edges[half], marks, light, tables, noise)
        of_levels = [tables.in_band(of) for of in levels]
        free.append(on_ground)
        halves.append(
            [
                on_ground + step + (first + 0.5 * second) / len(band)
                for step, first, second in zip(steps, *of_levels, strict=True)
            ]
        )
    weight = np.clip(along / CORRELATION, MINIMUM_ALONG, 1)[:, None] * samples.visible
    weighted = np.array(halves) * weight[:, None]  # half, bit, k, m
    beside = np.array(free) * weight  # half, k, m
    inked = np.stack(
        [tables.may_be_ink(ground) for ground in (samples.inner_ground, samples.outer_ground)], 1
    )
    return PrintEvidence(
        weighted.transpose(2, 1, 0, 3),
        beside.transpose(1, 0, 2),
        inked,
        evidence.onto,
        evidence.off,
        evidence.edges,
        light.uneven,
    )


class _Tables:
    """Evidence of levels, looked up by their bins."""

    def __init__(self, light: Light) -> None:
        anything = _LIKE_GROUND * light.ground + (1 - _LIKE_GROUND) * _ANYTHING
        self._densities = light.ground, light.marks
        self._on_ground = np.log((light.ground + _GROUND_FLOOR) / anything)
        self._in_band = [np.log((table + _FLOOR) / anything) for table in self._densities]
        self._inked = (light.marks > _INKED * light.ground) & (light.marks > _INK_DENSITY)

    def on_ground(self, values: np.ndarray) -> np.ndarray:
        """Return the evidence of gap or margin for being free."""
        return np.take_along_axis(self._on_ground, level_bins(values), axis=1)

    def in_band(self, values: np.ndarray) -> list[np.ndarray]:
        """Return the evidence of the band for ground and for a mark."""
        places = level_bins(values)
        return [np.take_along_axis(table, places, axis=1) for table in self._in_band]

    def densities(self, values: np.ndarray) -> list[np.ndarray]:
        """Return the densities of values under the light, on ground and on marks."""
        places = level_bins(values)
        return [np.take_along_axis(table, places, axis=1) for table in self._densities]

    def may_be_ink(self, values: np.ndarray) -> np.ndarray:
        """Return whether values are those of marks."""
        return np.take_along_axis(self._inked, level_bins(values), axis=1)


def _noise(gap: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return the noise of gray values, shape (k,), from readings that are far enough apart."""
    lags = np.clip(np.ceil(CORRELATION / along), 1, gap.shape[2] // 4).astype(int)
    later = (np.arange(gap.shape[2]) + lags[:, None]) % gap.shape[2]
    change = [np.take_along_axis(of, later, axis=1) - of for of in gap]
    usual = np.median(np.abs(np.concatenate(change, axis=1)), axis=1) * 1.4826 / np.sqrt(2)
    return np.maximum(NOISE, usual)


def _glare(samples: BandSamples) -> np.ndarray:
    """Return the evidence of a saturated reading for glare, shape (k, 1).

    Where nearly all of the ground is saturated, that is the exposure.
    """
    share = (samples.ground >= _SATURATED).mean(axis=(0, 2))
    begin, end = _WHITE_OUT
    return _SATURATION * np.clip((end - share) / (end - begin), 0, 1)[:, None]


def _steps(
    ground: np.ndarray,
    band: np.ndarray,
    on_edge: np.ndarray,
    marks: MarkAppearance,
    light: Light,
    tables: _Tables,
    noise: np.ndarray,
) -> list[np.ndarray]:
    """Return the evidence of steps across an edge of the band for ground and for a mark."""
    step = log_ratio(band, ground)
    noise = noise[:, None] * np.hypot(1 / (band + LOG_OFFSET), 1 / (ground + LOG_OFFSET))
    flat = normal_density(step, np.hypot(light.spread[:, None], noise))
    inked = mark_step_density(step, np.maximum(band, ground), marks, noise)
    edges = light.edges[:, None]
    anything = _PLAIN * flat + (1 - _PLAIN) * _ANY_STEP
    evidence = [
        np.log(((1 - edges) * same_light + edges * other_light + _FLOOR) / anything)
        for same_light, other_light in zip((flat, inked), tables.densities(band), strict=True)
    ]
    dark = np.minimum(ground, band)
    middle = (on_edge - dark) / np.maximum(np.abs(ground - band), 1)
    sure = (1 - _MISPLACED) * (1 - np.maximum(edges - _MINIMUM_EDGES, 0)) ** _EVEN
    density = sure * normal_density(middle - _MIDDLE, _MIDDLE_SPREAD) + (1 - sure) * _ANY_MIDDLE
    of_place = np.clip(np.log(density / _ANY_MIDDLE), *_MIDDLE_RANGE)
    evidence[1] += np.where(np.abs(step) > _MIDDLE_STEP, of_place, 0)
    return evidence
