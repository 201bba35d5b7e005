"""The likelihood of what is seen about a dot: paper, ink, or anything.

Ink multiplies light, so that in ln I the edge of a mark is a step of known height wherever the
light falls. At every angle two kinds of readings are compared with what paper and ink would give:

- steps across the inner and the outer edge of the band, with the light on the ground beside them;
- levels in gap, band and margin, with the light that the rest of the target's ground shows, where
  light repeats itself or is even (`light.predicted_light`).

All are logarithms of ratios to the density of what lies about any dot: flat ground mostly, else
edges of any height. Their sum over a target is the log odds of a word against no target at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.ring.polar import CORRELATION, INNERMOST, LIGHT_EDGE, PolarImages
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import SOFT
from ahf_ros.vision.image import SATURATED
from ahf_ros.vision.logarithm import LOG_OFFSET

_BESIDE = 2.6  # distance of a reading from an edge that is sharp, px
_MINIMUM_BESIDE, _MAXIMUM_BESIDE = 0.13, 0.36  # bounds of that distance, dot radii
_FLAT = 0.12  # deviation of steps of ln where there is no edge, but for noise
_WHITE = 0.03  # the same of paper between ground that glare makes white
_MARK, _MARK_TAIL = 0.18, 0.3  # of the step of a mark: towards less, where blur fills it, and more
_PAPER_LEVEL, _INK_LEVEL = 0.05, 0.12  # of levels of paper and ink under predicted light
_ANY = 0.22  # density of steps and levels of ln where anything lies
_PLAIN = 0.35  # share of what lies about any dot that is as flat as ground
_MARKED = 0.2  # share of what is dark that has marks, from which it is in shadow
_AT_ENDS = 0.25  # probability that an end of an arc does not look as blur alone makes it
_FURTHER = 0.1  # price of each further reading in light that nothing predicts
_UNLIKELY = 2.5  # standard deviations, from which a level was not predicted
_ACROSS = (0.3, 0.75)  # shares of the gap, between which edges of light show
_ANGLES = 120  # at which large targets have all the evidence that readings can give
_MAXIMUM_GROWTH = 0.3  # dot radii
_RADIUS, _DEPTH = 2.25, 0.2  # of readings, and distance of their depths, dot radii
_SHARE = 0.12  # error of shares of ink between paper and ink, as far apart as these are

SHARES = (0.25, 0.5, 0.75)
"""Of ink between paper and ink, where blur mixes both at ends of arcs."""

SURPRISES = (0.05, 0.5)
"""Least and largest probability of light that nothing predicts."""

# In the order of band_edges.c.
_DECIDING = np.array(
    [
        *(INNERMOST, LOG_OFFSET, SATURATED),
        *(_BESIDE, SOFT, _MINIMUM_BESIDE, _MAXIMUM_BESIDE, *_ACROSS),
        *(LIGHT_EDGE, *SURPRISES, _MARKED),
        *(_FLAT, _WHITE, _MARK, _MARK_TAIL, _SHARE, _ANY, _PLAIN, _AT_ENDS),
        *(_PAPER_LEVEL, _INK_LEVEL, _UNLIKELY),
    ]
)

HOPEFUL = 0.2
"""Mean log odds of a reading, from which a band is read on."""

FEW_MARKS = 1 / 16
"""Marked share of a band, below which words against paper have less evidence than that."""


@dataclass(frozen=True, slots=True)
class Evidence(ArrayRecord):
    """Log likelihoods of k targets at m angles, over those of anything.

    The inner and the outer half of the band, with the ground beside each, are seen apart, because
    what lies on one may leave the other.

    Attributes
    ----------
    looks : ndarray of float32, shape (k, 2, n, m)
        For shares of ink in equal steps from paper to ink: where the band is unmarked, where blur
        mixes both, and where it is marked.
    typical : ndarray of float32, shape (k, 2, 2, m)
        What edges of paper and of ink give on average where these look as they should, as far as
        edges of light let them.
    weight : ndarray of float32, shape (k,)
        Of a reading, which is part of all; less than 1 where neighbours tell the same.
    dot : ndarray of float32, shape (k,)
        Of the dot as ink, over the dot as light on paper.
    lit : ndarray of float32, shape (k,)
        Probability that an edge of light lies between two neighbouring readings.
    covered : ndarray of bool, shape (k, 2, m)
        Where something covers the ground beside the band.
    blur : ndarray of float64, shape (k,)
        Of ends of arcs, standard deviation in angles.
    """

    looks: np.ndarray
    typical: np.ndarray
    weight: np.ndarray
    dot: np.ndarray
    lit: np.ndarray
    covered: np.ndarray
    blur: np.ndarray

    @property
    def paper(self) -> np.ndarray:
        """Evidence for unmarked bands, shape (k, 2, m)."""
        return self.looks[..., 0, :]

    @property
    def ink(self) -> np.ndarray:
        """Evidence for marked bands, shape (k, 2, m)."""
        return self.looks[..., -1, :]

    def plus(self, levels: Evidence) -> Evidence:
        """Return the sum of the evidence of edges and of levels, where nothing covers the ground.

        What covers the ground beside an edge covers the edge, and may reach under the levels of
        both halves.
        """
        beside = np.logical_or.reduce(self.covered, axis=1, keepdims=True)
        anywhere = np.logical_or.reduce(beside, axis=2, keepdims=True)
        across = beside | (levels.covered & anywhere)
        return Evidence(
            looks=np.where(self.covered[:, :, None], 0, self.looks)
            + np.where(across[:, :, None], 0, levels.looks),
            typical=self.typical,
            weight=self.weight,
            dot=self.dot + levels.dot,
            lit=np.maximum(self.lit, levels.lit),
            covered=self.covered,
            blur=self.blur,
        )


def growth_by(shift: float | np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the growth of dots of radii (k,) by shifts of edges, both px, in dot radii, (k,)."""
    return np.clip(shift / size, -_MAXIMUM_GROWTH, _MAXIMUM_GROWTH)


def band_edges(
    radius: np.ndarray, growth: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii of the edges of a band whose ink has grown on all sides, (k,) each.

    The radii of dots as printed and the growth of their colour, (k,), have the unit of the frame.
    """
    inner, outer = band
    return inner * radius - growth, outer * radius + growth


def weights(polar: PolarImages) -> np.ndarray:
    """Return the weights of readings at neighbouring angles, ndarray of float32, shape (k,).

    They add up to the same for bands of all families, so that their evidence can be compared.
    """
    angles = polar.gray.shape[2]
    along = 2 * np.pi * _RADIUS * polar.size / angles / CORRELATION
    return np.minimum(along, min(1.0, _ANGLES / angles)).astype(np.float32)


def edge_evidence(
    polar: PolarImages,
    radius: np.ndarray,
    growth: np.ndarray,
    band: tuple[float, float],
    shares: Sequence[float] = (),
) -> Evidence:
    """Return the evidence of steps across the edges of bands, and of those of shares of ink.

    From the radii of the dots as printed and the growth of their colour, (k,), units of the frame.
    """
    inner, outer = band_edges(radius, growth, band)
    edges, weight = np.stack([radius + growth, inner, outer], axis=1), weights(polar)
    every = np.array([0, *shares, 1], np.float32)
    looks, typical, covered, lit, *_ = kernels.edge_evidence(
        *_on_circles(polar), edges, weight, every, _DECIDING
    )
    return Evidence(
        looks=looks,
        typical=typical,
        weight=weight,
        dot=np.zeros_like(weight),
        lit=lit,
        covered=covered,
        blur=_blur_along(polar, band),
    )


def shifted_evidence(
    polar: PolarImages, shifts: Sequence[float] | np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return growths of ink by s shifts of edges, px, and the evidence for paper and for ink then.

    The growths, (k, s), are in radii of the dots as they are seen; the evidence of both edges
    together has the shape (k, s, 2, m).
    """
    growth = growth_by(np.asarray(shifts), polar.size[:, None])
    edges = np.stack([np.ones_like(growth), *band_edges(1 - growth, growth, band)], axis=2)
    looks, *_ = kernels.shifted_evidence(*_on_circles(polar), edges, weights(polar), _DECIDING)
    return growth, looks


def _on_circles(polar: PolarImages) -> tuple[np.ndarray, ...]:
    """Return polar images as kernels take them."""
    of = polar.outermost, polar.size, polar.blur, polar.polarity, polar.contrast, polar.noise
    looks = np.stack([*of, polar.shade, polar.glare, polar.brightest], axis=1)
    return polar.gray, polar.row, polar.reach, polar.plate, looks


def _blur_along(polar: PolarImages, band: tuple[float, float]) -> np.ndarray:
    """Return the blur of ends of arcs, standard deviations in angles, shape (k,)."""
    return np.asarray(polar.blur / (np.pi * sum(band) * polar.size / polar.gray.shape[2]))


def level_evidence(
    polar: PolarImages,
    levels: np.ndarray,
    light: np.ndarray,
    spread: np.ndarray,
    radii: np.ndarray,
    growth: np.ndarray,
    band: tuple[float, float],
    shares: Sequence[float] = (),
) -> Evidence:
    """Return the evidence of levels in dots and bands, and beside these, under predicted light.

    Gray values `levels`, shape (k, d, m), were read at radii (d,): in the dot, in the gap, in the
    band or beyond it. `light` and `spread`, as `predicted_light` gives them, are what paper has
    there and the deviation of its logarithm. Of `polar` only the looks of ink and of edges are
    used. The growth of the dots' colour, (k,), is in units of the radii.
    """
    edges = np.stack(band_edges(np.ones(len(growth)), growth, band), axis=1)
    depth = np.minimum(_DEPTH * polar.size / CORRELATION, 1)
    weight, every = (weights(polar) * depth).astype(np.float32), np.array([0, *shares, 1])
    reach = np.minimum(polar.reach, polar.rim(band[1])[:, 0])
    *_, looks_of = _on_circles(polar)
    looks, dot, lit, covered, *_ = kernels.level_evidence(
        *(levels, light, spread, radii, band, edges, reach, looks_of, weight, every, _DECIDING)
    )
    looks *= _predicted(looks.max(axis=2), weight)[:, :, None]
    typical = np.zeros((*looks.shape[:2], 2, looks.shape[3]), np.float32)
    return Evidence(looks, typical, weight, dot, lit, covered, _blur_along(polar, band))


def _predicted(best: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return where light is as predicted, bool, from the best evidence of levels, (k, 2, m) both.

    `weight`, shape (k,), is that of a reading.

    Light that nothing predicts comes in stretches, each of which has its price. Where the best
    path through it (Viterbi 1967) leads, levels say nothing of any word.
    """
    further = np.repeat(np.float32(_FURTHER) * weight, best.shape[1])
    of_paths = best.reshape(-1, best.shape[2]), further, -math.log(SURPRISES[0])
    return kernels.predicted_angles(*of_paths)[0].reshape(best.shape)


def normal(values: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the densities of values under normal distributions about 0."""
    return np.exp(-0.5 * (values / spread) ** 2) / (spread * math.sqrt(2 * math.pi))
