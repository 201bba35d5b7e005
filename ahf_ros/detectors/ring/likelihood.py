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

from dataclasses import dataclass

import numpy as np

from ahf_ros.detectors.ring.polar import CORRELATION, SATURATED, PolarImages
from ahf_ros.features.array_record import ArrayRecord

_BESIDE = 2.6  # distance of a reading from an edge that is sharp, px
_NEAREST, _FARTHEST = 0.13, 0.36  # bounds of that distance, dot radii
_FLAT = 0.12  # deviation of steps of ln where there is no edge, but for noise
_MARK, _MARK_TAIL = 0.18, 0.3  # of the step of a mark: towards less, where blur fills it, and more
_LEVEL = 0.12  # of levels about predicted light
_ANY_STEP, _ANY_LEVEL = 0.2, 0.25  # densities of steps and levels of ln where anything lies
_PLAIN = 0.35  # share of what lies about any dot that is as flat as ground
_SURPRISE = 0.35  # probability of a level that nothing predicts
_LIGHT_EDGE = 0.3  # of ln, of an edge of light
_LIGHT_EDGES = (0.02, 0.5)  # smallest and largest probability of one between two readings
_MINIMUM_WEIGHT = 0.08  # of a reading among many that are alike
_WHITE_OUT = (0.7, 0.9)  # share of the ground that is saturated, where it begins to be no glare


@dataclass(frozen=True, slots=True)
class Evidence(ArrayRecord):
    """Log likelihoods of k targets at m angles, over those of anything.

    Attributes
    ----------
    paper, ink : ndarray of float32, shape (k, m)
        Where the band is unmarked, and where it is marked.
    weight : ndarray of float32, shape (k,)
        Of a reading, which is part of both; less than 1 where neighbours tell the same.
    dot : ndarray of float32, shape (k,)
        Of the dot as ink, over the dot as light on paper.
    """

    paper: np.ndarray
    ink: np.ndarray
    weight: np.ndarray
    dot: np.ndarray

    def plus(self, other: Evidence) -> Evidence:
        """Return the sum of two kinds of evidence at the same angles."""
        return Evidence(
            paper=self.paper + other.paper,
            ink=self.ink + other.ink,
            weight=self.weight,
            dot=self.dot + other.dot,
        )


def band_edges(
    radius: np.ndarray, growth: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii of the edges of a band whose ink has grown on all sides, shape (k,) each.

    Parameters
    ----------
    radius : ndarray of float64, shape (k,)
        Of the dot as printed.
    growth : ndarray of float64, shape (k,)
        Of what has the colour of the dot; the unit of both is that of the frame.
    band : tuple of 2 float
        Radii of the band, dot radii.
    """
    inner, outer = band
    return inner * radius - growth, outer * radius + growth


def weights(polar: PolarImages, inner: float) -> np.ndarray:
    """Return the weights of readings at neighbouring angles, ndarray of float32, shape (k,)."""
    along = 2 * np.pi * inner * polar.size / polar.gray.shape[1]
    return np.clip(along / CORRELATION, _MINIMUM_WEIGHT, 1).astype(np.float32)


def edge_evidence(
    polar: PolarImages, radius: np.ndarray, growth: np.ndarray, band: tuple[float, float]
) -> Evidence:
    """Return the evidence of steps across the edges of bands.

    Parameters
    ----------
    polar : PolarImages
        Of k dots.
    radius, growth, band
        As for `band_edges`.
    """
    inner, outer = band_edges(radius, growth, band)
    beside = np.clip(_BESIDE / polar.size, _NEAREST, _FARTHEST)
    beside = np.minimum(beside, 0.45 * (outer - inner))
    before = np.minimum(beside, 0.5 * (inner - radius - growth))
    edges = light_edges(polar, radius, growth, inner)
    weight = weights(polar, band[0])
    glare = _glare(polar, radius, inner)
    paper, ink = np.zeros((2, *polar.visible.shape), np.float32)
    for ground, band in ((inner - before, inner + beside), (outer + beside, outer - beside)):
        seen = polar.at(band), polar.at(ground)
        of_paper, of_ink = _step_evidence(polar, *seen, edges)
        clear = (seen[0] < SATURATED) | ~glare[:, None]
        paper += np.where(clear, of_paper, np.minimum(of_paper, 0))
        ink += of_ink
    share = weight[:, None] * polar.visible
    return Evidence(paper * share, ink * share, weight, np.zeros_like(weight))


def light_edges(
    polar: PolarImages, radius: np.ndarray, growth: np.ndarray, inner: np.ndarray
) -> np.ndarray:
    """Return the probabilities of an edge of light between neighbours, as gaps show it, (k,)."""
    start, width = radius + growth, inner - radius - growth
    near, far = (polar.logs(polar.at(start + part * width)) for part in (0.3, 0.75))
    noise = np.hypot(near[1], far[1])
    many = (np.abs(near[0] - far[0]) > np.hypot(_LIGHT_EDGE, 2 * noise)).mean(axis=1)
    return np.clip(many, *_LIGHT_EDGES)


def _glare(polar: PolarImages, radius: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return whether saturated readings are glare, not the exposure of all paper, shape (k,)."""
    share = (polar.at((radius + inner) / 2) >= SATURATED).mean(axis=1)
    return np.asarray(share < _WHITE_OUT[0])


def _step_evidence(
    polar: PolarImages, band: np.ndarray, ground: np.ndarray, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence of steps from ground into a band for paper and for ink, (k, m) each."""
    (level, noise), (beside, of_ground) = polar.logs(band), polar.logs(ground)
    mark = polar.logs(polar.inked(ground, band))[0] - beside
    noise = np.hypot(noise, of_ground)
    step = level - beside
    flat = _normal(step, np.hypot(np.float32(_FLAT), noise))
    more = (step - mark) * np.sign(mark)
    low, high = (np.hypot(np.float32(spread), noise) for spread in (_MARK, _MARK_TAIL))
    width = np.where(more > 0, high, low)
    inked = _normal(more, width) * (2 * width / (low + high))
    lit = edges.astype(np.float32)[:, None]
    anything = _PLAIN * flat + (1 - _PLAIN) * _ANY_STEP
    paper, ink = (
        np.log(((1 - lit) * density + lit * _ANY_STEP) / anything) for density in (flat, inked)
    )
    return paper, ink


def level_evidence(
    polar: PolarImages,
    levels: np.ndarray,
    light: np.ndarray,
    spread: np.ndarray,
    radii: np.ndarray,
) -> Evidence:
    """Return the evidence of levels in dots and bands under light that is predicted.

    Parameters
    ----------
    polar : PolarImages
        Of k targets, for how ink looks.
    levels : ndarray of float32, shape (k, m, d)
        Gray values.
    light : ndarray of float32, shape (k, m, d)
        Gray values of paper there, as `predicted_light` gives them.
    spread : ndarray of float32, shape (k, m, d)
        Deviation of its logarithm; infinite where nothing predicts it.
    radii : ndarray of float64, shape (d,)
        Where they are, in dot radii; those below 1 are in the dot.
    """
    level, noise = polar.logs(levels)
    known = np.isfinite(spread)
    width = np.sqrt(_LEVEL**2 + noise**2 + np.where(known, spread, 1) ** 2)
    densities = [
        _normal(level - polar.logs(of)[0], width) for of in (light, polar.inked(light, levels))
    ]
    anything = _PLAIN * densities[0] + (1 - _PLAIN) * _ANY_LEVEL
    along = 2 * np.pi * radii / levels.shape[1]
    apart = np.diff(radii, append=2 * radii[-1] - radii[-2])
    share = np.prod(
        [
            np.clip(of * polar.size[:, None] / CORRELATION, _MINIMUM_WEIGHT, 1)
            for of in (along, apart)
        ],
        axis=0,
    ).astype(np.float32)
    seen = known & polar.visible[..., None]
    paper, ink = (
        np.where(seen, np.log(((1 - _SURPRISE) * of + _SURPRISE * _ANY_LEVEL) / anything), 0)
        * share[:, None]
        for of in densities
    )
    band = radii > 1
    dot = (ink - paper)[..., ~band].sum(axis=(1, 2))
    return Evidence(paper[..., band].sum(axis=2), ink[..., band].sum(axis=2), share[:, -1], dot)


def _normal(values: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the densities of values under normal distributions about 0."""
    density: np.ndarray = np.exp(-0.5 * (values / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
    return density
