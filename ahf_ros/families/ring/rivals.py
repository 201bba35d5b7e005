"""The families that are not read, and may explain a band better than those that are.

Where arcs of any length explain a band nearly as well as its word, the target may be one of a
family that nobody asked for. What any word of a print can reach is bounded first, by one polar
image for all numbers of sectors in a band: each sector is paper, ink, or covered, and what blur
mixes at its borders agrees with both. Only families whose bound is high enough read the band.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ahf_ros.families.ring.decoding import COVER, without_outliers
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import Prior
from ahf_ros.families.ring.likelihood import SHARES, edge_evidence
from ahf_ros.families.ring.polar import polar_images
from ahf_ros.families.ring.reading import best_growth, read_bands
from ahf_ros.prints.ring import FAMILY_NAMES, RingPrint, family
from ahf_ros.vision.circle_fit import Fit

_FIRST = 8  # doubtful words that rivals read first
_MORE_SEEN = 6.0  # log odds against anything, by which a family that is not read beats one that is
_BELOW, _SHARE_BELOW = 5.0, 0.05  # bound below the evidence of a word, as dots alone place bands
_ANGLES = 240  # of polar images that all numbers of sectors share
_PHASES = 12  # of sectors, within one of them
_PARTS = 2  # of a sector, each of which may be covered
_MIXED = 0.1  # of a sector, at either end, where the next one may agree as well


def against_rivals(
    gray: np.ndarray, dots: Fit, found: Hypotheses, families: Sequence[RingPrint], prior: Prior
) -> Hypotheses:
    """Return hypotheses of dots, none certain where a family that is not read has more evidence.

    Where rivals contest most of the most doubtful words, they read all.
    """
    certain = np.flatnonzero(found.certain)
    order = certain[np.argsort(found.coded[certain], kind='stable')]
    first = order[: min(_FIRST, (~found.clear[certain]).sum())]
    known = [family(name) for name in FAMILY_NAMES]
    rivals = [rival for rival in known if not any(has_all(code, rival) for code in families)]
    confidence = found.confidence.copy()
    for some in (first, order[len(first) :]):
        if not some.size or not rivals:
            break
        beaten = _beaten(gray, dots.select(some), found.select(some), rivals, prior)
        confidence[some[beaten]] = 0.0
        if beaten.mean() < 0.5:
            break
    return replace(found, confidence=confidence)


def _beaten(
    gray: np.ndarray, dots: Fit, words: Hypotheses, rivals: Sequence[RingPrint], prior: Prior
) -> np.ndarray:
    """Return whether any of the rivals explains the bands of words better, shape (k,)."""
    beaten = np.zeros(len(words.words), bool)
    for band in dict.fromkeys(code.band for code in rivals):
        of_band = [code for code in rivals if code.band == band]
        least = words.seen - np.minimum(_BELOW, _SHARE_BELOW * words.seen)
        ceilings = word_ceilings(gray, dots, band, [code.bits for code in of_band], prior)
        for code, ceiling in zip(of_band, ceilings, strict=True):
            asked = np.flatnonzero((ceiling > least) & ~beaten)
            if not asked.size:
                continue
            word = words.select(asked)
            needed = word.seen + _MORE_SEEN
            other = read_bands(gray, dots.select(asked), code, prior, needed)
            beaten[asked[(other.seen > needed) & (odds(other) > odds(word))]] = True
    return beaten


def word_ceilings(
    gray: np.ndarray, dots: Fit, band: tuple[float, float], numbers: Sequence[int], prior: Prior
) -> np.ndarray:
    """Return bounds of the log odds of words against anything, by numbers of sectors, (n, k)."""
    polar = polar_images(gray, dots, band, _ANGLES)
    growth = best_growth(polar, band, prior)
    edges = without_outliers(edge_evidence(polar, 1 - growth, growth, band, SHARES))
    either = edges.looks.max(axis=1)
    sums = np.cumsum(np.tile([edges.paper, edges.ink, either], 3), axis=2, dtype=np.float64)

    def between(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return the sums from some places to others in sectors, (3, k) and their shape."""
        places = np.stack([starts, ends]) * _ANGLES + _ANGLES
        below = np.floor(places).astype(np.intp)
        share = places - below
        until = sums[..., below - 1] * (1 - share) + sums[..., below] * share
        return np.asarray(until[:, :, 1] - until[:, :, 0])

    ceilings = []
    for bits in numbers:
        starts = (np.arange(bits) + np.arange(_PHASES)[:, None] / _PHASES) / bits
        part = (1 - 2 * _MIXED) / _PARTS / bits
        inner = starts[..., None] + _MIXED / bits + part * np.arange(_PARTS)
        paper, ink, _ = np.maximum(between(inner, inner + part), -COVER / _PARTS).sum(axis=-1)
        *_, ends = between(starts - _MIXED / bits, starts + _MIXED / bits)
        ceilings.append((np.maximum(paper, ink) + ends).sum(axis=2).max(axis=1))
    return np.array(ceilings)


@lru_cache(maxsize=256)  # bands that are measured make families of their own in every image
def has_all(code: RingPrint, other: RingPrint) -> bool:
    """Return whether a family has all words of another one, in the same print."""
    same = (code.band, code.bits) == (other.band, other.bits)
    return same and bool(code.has(other.words).all())


def has_more(code: RingPrint, other: RingPrint) -> bool:
    """Return whether a family has all words of another one, and further ones."""
    return has_all(code, other) and len(code.words) > len(other.words)


def odds(read: Hypotheses) -> np.ndarray:
    """Return how well words of any family agree with arcs, -inf if they are not certain, (k,)."""
    choices = [len(code.words) * code.bits for code in read.families]
    return np.where(read.certain, read.coded - np.log(np.maximum(choices, 1)), -np.inf)
