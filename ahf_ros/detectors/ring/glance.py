"""Which dots may be middles of targets, by bounds that take a small part of the time of reading.

Most dots of a scene are none: spots of a lattice, holes, letters, sectors of bands. The sectors of
any word are each paper, ink, or covered, so that the best of the three in each sector bounds the
evidence of the edges for every word, and what speaks for ink rather than paper bounds that against
bare paper. A bright dot that looks like what lies beyond the band is a hole in something dark, as
those of letters are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.likelihood import edge_evidence, growth_by
from ahf_ros.detectors.ring.polar import DOT, MARGIN, PolarImages, polar_images
from ahf_ros.features.circle_fit import Fit

_PER_SECTOR, _CIRCLES = 5, 36  # angles of the shortest sectors, and circles
_PHASES = 4  # of the sectors
_SHIFTS = (-1.2, 0.0, 1.2)  # of edges, px; readings keep farther away from these than the error
_COVER = 5.0  # price of a sector that is covered, less than where words are decoded
_HOPEFUL = 0.1  # bound of the mean evidence of a reading, from which a band is read
_CAP = 3.0  # evidence of a reading against bare paper
_ALIKE, _MOST = 0.15, 0.5  # difference of ln, and share of what is beyond, that show a hole


def may_be_targets(gray: np.ndarray, dots: Fit, families: Sequence[Family]) -> np.ndarray:
    """Return whether dots may be the middles of targets of any family, shape (k,).

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Fit
    families : sequence of Family
    """
    bits: dict[tuple[float, float], set[int]] = {}
    for code in families:
        bits.setdefault(code.band, set()).add(code.bits)
    bounds = [_bound(gray, dots, band, of_band) for band, of_band in bits.items()]
    return np.asarray(np.max(bounds, axis=0) > _HOPEFUL)


def _bound(gray: np.ndarray, dots: Fit, band: tuple[float, float], bits: set[int]) -> np.ndarray:
    """Return a bound of the mean evidence of readings for words of some lengths, shape (k,)."""
    angles = _PER_SECTOR * max(bits)
    polar = polar_images(gray, dots, band, angles, _CIRCLES)
    best = np.full(len(dots.frames), -np.inf)
    for shift in _SHIFTS:
        growth = growth_by(shift, polar.size)
        edges = edge_evidence(polar, 1 - growth, growth, band)
        cap = _CAP * edges.weight[:, None]
        for count in bits:
            paper, ink = (_of_sectors(of.sum(axis=1), count) for of in (edges.paper, edges.ink))
            of_word = np.maximum(np.maximum(paper, ink), -_COVER).sum(axis=2)
            marked = _of_sectors(np.clip((edges.ink - edges.paper).sum(axis=1), -cap, cap), count)
            bound = np.minimum(of_word, np.maximum(marked, 0).sum(axis=2)).max(axis=1)
            best = np.maximum(best, bound / (angles * edges.weight))
    return np.where(_holes(polar, band), -np.inf, best)


def _holes(polar: PolarImages, band: tuple[float, float]) -> np.ndarray:
    """Return whether dots are holes through which one sees what lies beyond the band, (k,)."""
    one = np.ones(len(polar.size))
    inside, outside = (
        np.concatenate([polar.logs(polar.at(one * radius))[0] for radius in radii], axis=1)
        for radii in (DOT, band[1] + MARGIN)
    )
    alike = np.abs(outside - np.median(inside, axis=1, keepdims=True)) < _ALIKE
    return np.asarray((polar.polarity < 0) & (alike.mean(axis=1) > _MOST))


def _of_sectors(values: np.ndarray, bits: int) -> np.ndarray:
    """Return the sums of values (k, m) over sectors at some phases, shape (k, phases, bits)."""
    count = values.shape[1]
    sums = np.cumsum(np.concatenate([values, values], axis=1), axis=1, dtype=np.float64)
    starts = (np.arange(_PHASES)[:, None] / _PHASES + np.arange(bits)) * count / bits
    ends = starts + count / bits

    def until(places: np.ndarray) -> np.ndarray:
        """Return the integral from the first value to places, of steps of width 1."""
        below = places.astype(np.intp)
        before = np.where(below > 0, sums[:, np.maximum(below - 1, 0)], 0.0)
        return before + (places - below) * (sums[:, below] - before)

    return until(ends) - until(starts)
