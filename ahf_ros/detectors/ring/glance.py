"""Which dots may be middles of targets, at a glance.

Most dots of a scene are not: spots of a lattice, holes, letters, sectors of bands. To see that
takes a small part of the time that it takes to measure and to read them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.band_samples import (
    beside_edges,
    edge_circles,
    gap_circles,
    near_borders,
)
from ahf_ros.detectors.ring.evidence import light_levels, log_ratio, step_evidence
from ahf_ros.detectors.ring.surroundings import designs, seen_marks
from ahf_ros.features.sampling import sample_circles

_PER_SECTOR = 3  # angles a sector
_BLUR = 2.2  # that readings keep away from, px
_EACH, _BOTH = 0.5, 2.0  # evidence of each edge of a band for a mark, and of both, in units of ln


def may_be_targets(
    gray: np.ndarray, frames: np.ndarray, families: Sequence[Family], *, many: bool
) -> np.ndarray:
    """Return whether dots may be the middles of targets of any family, shape (k,).

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        To a few percent of the radius.
    families : sequence of Family
    many : bool
        Whether the image has so many dots that most are spots of light.
    """
    likely = np.zeros(len(frames), bool)
    for code in designs(families):
        inner, outer = _edge_evidence(gray, frames, code)
        marked = (np.minimum(inner, outer) > _EACH).sum(axis=1)
        if many:
            likely |= marked > 1
        else:
            likely |= (marked > 0) | ((inner + outer > _BOTH).sum(axis=1) > 1)
            likely |= near_borders(frames, code, gray.shape)
    return likely


def _edge_evidence(
    gray: np.ndarray, frames: np.ndarray, code: Family
) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence of the inner and the outer edge of bands for marks, shape (k, m)."""
    count = code.bits * _PER_SECTOR
    angles = 2 * np.pi * np.arange(count) / count
    beside = beside_edges(frames, _BLUR)
    fixed = np.broadcast_to(gap_circles(code), (len(frames), 2))
    radii = np.concatenate([1 - beside, 1 + beside, fixed, edge_circles(beside, code)], axis=1)
    values = np.moveaxis(np.maximum(sample_circles(gray, frames, angles, radii), 0), 2, 0)
    inside, outside, gap, edges = np.split(np.ascontiguousarray(values), (1, 2, 4))
    marks = seen_marks(inside[0], outside[0], log_ratio(outside[0], inside[0]))
    ground = np.concatenate([gap, edges[[0, 3]]])
    bright = np.where((marks.polarity > 0)[:, None], ground, inside)
    light = light_levels(np.moveaxis(bright, 0, 2), gap, marks)
    inner = step_evidence(edges[0], edges[1], marks, light)
    return inner, step_evidence(edges[3], edges[2], marks, light)
