"""Proposals of dots, and the measurement of those that may be middles of targets.

Most dots of a scene are none: spots of a lattice, holes, letters, sectors of bands. A glance tells
them apart by bounds that take a small part of the time of reading. The sectors of any word are
each paper, ink, or covered, so that the best of the three in each sector bounds the evidence of
the edges for every word, and what speaks for ink rather than paper bounds that against bare paper.
A bright dot that looks like what lies beyond the band is a hole in something dark, as those of
letters are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ahf_ros.families.ring.circles import RAYS, REACH
from ahf_ros.families.ring.known import Explained
from ahf_ros.families.ring.likelihood import FEW_MARKS, band_edges, shifted_evidence, weights
from ahf_ros.families.ring.polar import (
    DOT,
    MARGIN,
    PART,
    PolarImages,
    on_dark_ground,
    polar_images,
)
from ahf_ros.prints.ring import RingPrint, least_marked
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import ENOUGH, NO_FITS, Fit, fit_dots
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.dots import NO_DOTS, Dots
from ahf_ros.vision.pyramid import Octave
from ahf_ros.vision.robust import medians
from ahf_ros.vision.small_dots import small_dots_in

_MOST_ALIKE = 64  # dots in the shapes of targets that are looked at
_THIN = 4.0  # semi-minor axis of a dot whose gap edges of a half may not show, px
_NARROW = 3.0  # width of a gap, px, that edges of a half do not show on both of its sides
_PER_SECTOR, _CIRCLES = 5, 36  # angles of the shortest sectors, and circles
_PHASES = 4  # of the sectors
_MAXIMUM_SHIFT = 1.2  # of edges, px
_SHIFTS = 7  # that are tried; readings keep farther from edges than what is left
_COVER = 5.0  # price of a sector that is covered, less than where words are decoded
_CAP = 3.0  # evidence of a reading against bare paper
_ALIKE, _BEYOND = 0.15, 0.5  # difference of ln, and share of what is beyond, that show a hole

HOPEFUL = 0.1
"""Bound of the mean evidence of a reading, from which a band is read."""

Print = tuple[tuple[float, float], int]
"""Radii of a band, in dot radii, and number of its sectors."""

Proposal = Callable[[Octave, Sequence[int], Explained], Dots]
"""From an octave, the polarities of dots and what is explained already to dots of the octave."""


def propose_whole(octave: Octave, polarities: Sequence[int], _explained: Explained) -> Dots:
    """Return the dots of an octave with a whole outline."""
    return whole_dots(octave.pyramid, *octave.radii, polarities)


def propose_voted(octave: Octave, polarities: Sequence[int], explained: Explained) -> Dots:
    """Return the dots of an octave that edges vote for which nothing explains yet."""
    outlines = explained.outlines_in(octave.level)
    return voted_dots(octave.pyramid, *octave.radii, polarities, explained=outlines)


def propose_small(octave: Octave, polarities: Sequence[int], explained: Explained) -> Dots:
    """Return the small dots of the image in even light whose gap is too narrow for edges."""
    if octave.level:
        return NO_DOTS
    outlines = explained.outlines_in(octave.level)
    dots = small_dots_in(octave.pyramid, *octave.radii, polarities, outlines)
    return dots.select(frame.ellipse_axes(dots.frames)[1] < _THIN)


PROPOSALS: tuple[Proposal, ...] = (propose_whole, propose_voted, propose_small)
"""The ways to propose dots, the fastest first."""


def with_rims(dots: Dots, families: Sequence[RingPrint], min_radius: float) -> Dots:
    """Return dots, and those in the middle of what may be the rim of a band about a narrow gap.

    Edges of a half of an image do not show a dot whose gap is narrower than they are, but the rim
    of a band with many marks. Dots and the bound of their radius are px of one image.
    """
    size, found = frame.mean_radii(dots.frames), [dots]
    for inner, outer in dict.fromkeys(code.band for code in families if code.bounds is None):
        dot = size / outer
        some = np.flatnonzero((dot * (inner - 1) < _NARROW) & (dot > min_radius))
        middle = dots.select(some)
        frames = frame.scaled(middle.frames, np.full(len(some), 1 / outer))
        found.append(replace(middle, frames=frames))
    return Dots.joined(found)


def measure_dots(gray: np.ndarray, dots: Dots | Fit, *, covariances: bool = False) -> Fit:
    """Return the fits of dots, whose blur is that of an earlier fit or the usual one."""
    parts = (dots.select(slice(start, start + PART)) for start in range(0, len(dots.frames), PART))
    return Fit.joined([NO_FITS, *(_fit(gray, part, covariances=covariances) for part in parts)])


def measure_likely(
    gray: np.ndarray, dots: Fit, families: Sequence[RingPrint] | None
) -> tuple[Fit, Fit]:
    """Return better fits of the dots whose bands are worth reading, and those of the others.

    The most hopeful dots come first. Without families, all dots are worth it.
    """
    others, hope = NO_FITS, np.ones(len(dots.frames))
    if families is not None:
        hope = hopes(gray, dots, families)
        others = dots.select(hope <= HOPEFUL)
        dots, hope = dots.select(hope > HOPEFUL), hope[hope > HOPEFUL]
    fit = measure_dots(gray, dots, covariances=True)
    order = most_hopeful(fit, hope)
    return fit.select(order[fit.share[order] >= ENOUGH]), others


def most_hopeful(dots: Fit, hope: np.ndarray) -> np.ndarray:
    """Return the indices of dots, the most hopeful first, shape (k,).

    They come by their bands and by how clear they are themselves: gaps between spots of light have
    as much of a band as small targets, but are neither round nor dark.
    """
    return np.argsort(-hope * dots.clearness**2, kind='stable')


def measure_alike(gray: np.ndarray, dots: Dots) -> Fit:
    """Return dots in their shapes at the centres of their edges, those with most votes first.

    No more than the best ones are among them.
    """
    dots = dots.select(np.argsort(-dots.share, kind='stable')[:_MOST_ALIKE])
    fit = measure_dots(gray, dots, covariances=True)
    return replace(fit, frames=frame.centred(dots.frames, fit.frames[:, :2, 2]))


def _fit(gray: np.ndarray, dots: Dots | Fit, *, covariances: bool) -> Fit:
    """Return the fits of as many dots as the memory is bounded to."""
    return fit_dots(
        gray,
        dots.frames,
        dots.polarity,
        rays=RAYS // 2,
        reach=REACH,
        rounds=1,
        blur=dots.blur if isinstance(dots, Fit) else None,
        covariances=covariances,
    )


def hopes(gray: np.ndarray, dots: Fit, families: Sequence[RingPrint]) -> np.ndarray:
    """Return bounds of the mean evidence of readings for words of any family, shape (k,).

    Where few marks may be all that a word has, they are raised by as much.
    """
    prints = list(dict.fromkeys((code.band, code.bits) for code in families))
    least = min(1.0, *(least_marked(code) / FEW_MARKS for code in families))
    return np.asarray(bounds(gray, dots, prints).max(axis=0) / least)


def bounds(
    gray: np.ndarray, dots: Fit, prints: Sequence[Print], shifts: Sequence[float] = ()
) -> np.ndarray:
    """Return bounds of the mean evidence of readings for words of prints, shape (prints, k).

    For edges with some shifts, px; without any, with those that are usual.
    """
    best = np.full((len(prints), len(dots.frames)), -np.inf)
    for band in dict.fromkeys(band for band, _ in prints):
        of_band = [index for index, (radii, _) in enumerate(prints) if radii == band]
        bits = [prints[index][1] for index in of_band]
        for start in range(0, len(dots.frames), PART):
            part = slice(start, start + PART)
            best[of_band, part] = _bounds(gray, dots.select(part), band, bits, shifts)
    return best


def _bounds(
    gray: np.ndarray,
    dots: Fit,
    band: tuple[float, float],
    bits: Sequence[int],
    shifts: Sequence[float],
) -> np.ndarray:
    """Return the same for some numbers of sectors in one band, shape (numbers, k)."""
    angles = _PER_SECTOR * max(bits)
    polar = on_dark_ground(polar_images(gray, dots, band, angles, _CIRCLES), band)
    tried = shifts or np.linspace(-_MAXIMUM_SHIFT, _MAXIMUM_SHIFT, _SHIFTS)
    growth, looks = shifted_evidence(polar, tried, band)
    weight, holes = weights(polar)[:, None], _holes(polar, band_edges(1 - growth, growth, band)[1])
    cap = _CAP * weight[..., None, None]
    marked = np.clip(looks[:, :, 1:] - looks[:, :, :1], -cap, cap)
    looks = np.concatenate([looks, marked], axis=2)
    best = np.empty((len(bits), len(dots.frames)))
    for index, count in enumerate(bits):
        sectors = looks.reshape(-1, angles) @ _sectors(angles, count)
        paper, ink, marked = sectors.reshape(*looks.shape[:3], _PHASES, count).transpose(
            2, 0, 1, 3, 4
        )
        of_word = np.maximum(np.maximum(paper, ink), -_COVER).sum(axis=3)
        bound = np.minimum(of_word, np.maximum(marked, 0).sum(axis=3)).max(axis=2)
        best[index] = np.where(holes, -np.inf, bound / (angles * weight)).max(axis=1)
    return best


def _holes(polar: PolarImages, outer: np.ndarray) -> np.ndarray:
    """Return whether dots are holes through which one sees what lies beyond the band, (k, s).

    From s radii of the outer edges of each band, (k, s).
    """
    bright = np.flatnonzero(polar.polarity < 0)
    holes = np.zeros(outer.shape, bool)
    if not bright.size:
        return holes
    polar, beyond = (
        polar.select(bright),
        (outer[bright, :, None] + MARGIN).reshape(bright.size, -1),
    )
    inside, outside = (
        polar.levels(polar.at(radii)) for radii in (np.tile(DOT, (bright.size, 1)), beyond)
    )
    usual = medians(inside.reshape(bright.size, -1))[:, None, None]
    alike = (np.abs(outside - usual) < _ALIKE).mean(axis=2) > _BEYOND
    holes[bright] = alike.reshape(bright.size, -1, len(MARGIN)).all(axis=2)
    return holes


@lru_cache(maxsize=32)
def _sectors(count: int, bits: int) -> np.ndarray:
    """Return the shares of angles in sectors at some phases, float32, (count, phases bits)."""
    starts = (np.arange(_PHASES)[:, None] / _PHASES + np.arange(bits)) * count / bits
    angles = np.arange(2 * count)[:, None, None]
    inside = np.clip(
        np.minimum(starts + count / bits, angles + 1) - np.maximum(starts, angles), 0, 1
    )
    return (inside[:count] + inside[count:]).reshape(count, -1).astype(np.float32)
