"""Evidence of the samples of a band for marks in it, at every angle.

Three kinds of evidence that light cannot easily fake together are added:

- edges: the step across the inner and the outer edge of the band, against the step that a mark
  makes at the gray value found beside it;
- levels: the gray value itself, against those of bright places of the same target, as they are and
  as a mark would turn them;
- borders: the step along the band where two sectors meet, and its absence within them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.evidence import (
    MarkAppearance,
    border_evidence,
    level_evidence,
    light_levels,
    step_evidence,
)
from ahf_ros.features.frame import mean_radii

CORRELATION = 2.5
"""Distance of independent readings, px."""

MINIMUM_ALONG = 0.08
"""Weight of a reading along the band among many that are alike."""

_MINIMUM_ACROSS = 0.1  # the same, across the band


@dataclass(frozen=True, slots=True)
class BandEvidence:
    """Evidence about the bands of k targets at m angles, in units of ln, weighted.

    Attributes
    ----------
    steps : ndarray of float64, shape (2, k, m)
        For a mark, of the steps across the inner and the outer edge of the band.
    marked : ndarray of float64, shape (k, m)
        For a mark, of these steps and of the levels in the band.
    onto, off : ndarray of float64, shape (k, m)
        For a border onto a mark and off it, against none, after each angle.
    edges : ndarray of float64, shape (k,)
        Probability of an edge of light between two neighbouring points.
    """

    steps: np.ndarray
    marked: np.ndarray
    onto: np.ndarray
    off: np.ndarray
    edges: np.ndarray


def band_evidence(
    samples: BandSamples, marks: MarkAppearance, frames: np.ndarray, family: Family
) -> BandEvidence:
    """Weigh the samples of bands.

    Parameters
    ----------
    samples : BandSamples
        Of k targets.
    marks : MarkAppearance
    frames : ndarray of float64, shape (k, 3, 3)
        Of the targets.
    family : Family
    """
    inner, outer, size = family.band_inner, family.band_outer, mean_radii(frames)
    dark = (marks.polarity > 0)[:, None]
    bright = np.where(dark, samples.ground, np.concatenate([samples.dot, samples.dot]))
    light = light_levels(np.moveaxis(bright, 0, 2), samples.gap, marks)
    along = 2 * np.pi * inner * size / samples.visible.shape[2]
    weight = np.clip(along / CORRELATION, MINIMUM_ALONG, 1)[:, None]
    steps = [
        weight * visible * step_evidence(*edge, marks, light)
        for edge, visible in zip(samples.edges, samples.visible, strict=True)
    ]
    marked = sum(steps) + weight * samples.visible[0] * level_evidence(samples.band, light)
    across = (outer - inner) * size / len(samples.band)
    weight = np.clip(across / CORRELATION, _MINIMUM_ACROSS, 1)[:, None]
    weight = weight * samples.visible.all(axis=0)
    onto, off = (weight * border for border in border_evidence(samples.band, marks, light))
    return BandEvidence(np.stack(steps), marked, onto, off, light.edges)
