"""Reading of the bands about dots, in a line of stages.

Polar images of the dots; the growth of ink; the evidence of edges, which is a bound for what can
be a target; the evidence of levels in the light that a target's ground predicts; the words; the
joint fit of dot and band. A right word improves the frame and a better frame the evidence, so that
evidence, words and fit come twice. What else a band may be is asked the second time only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ahf_ros.families.ring.appearance import unlike_print
from ahf_ros.families.ring.borders import with_ends
from ahf_ros.families.ring.circles import reach_of, target_circles
from ahf_ros.families.ring.confidence import rated
from ahf_ros.families.ring.decoding import CLEAR, DOUBT, Words, decode
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import NOTHING_KNOWN, Prior
from ahf_ros.families.ring.light import clear_of, predicted_light
from ahf_ros.families.ring.likelihood import (
    FEW_MARKS,
    HOPEFUL,
    SHARES,
    Evidence,
    edge_evidence,
    level_evidence,
    shifted_evidence,
)
from ahf_ros.families.ring.polar import (
    DEPTHS,
    DOT,
    GAP,
    MARGIN,
    PART,
    PolarImages,
    angles_of,
    in_uneven_light,
    lift_ratio,
    on_circles,
    on_dark_ground,
    polar_images,
)
from ahf_ros.prints.ring import RingPrint, canonical, least_marked
from ahf_ros.vision import frame
from ahf_ros.vision.black import AS_IT_IS, BLACK, NEARLY_LINEAR, PRINTED
from ahf_ros.vision.circle_fit import ENOUGH, NO_FITS, Fit, fit_circles

PER_SECTOR = 10
"""Angles of a sector at which bands are read."""

_PROPORTION = 0.06  # by which bands may be larger or smaller beside their dots than printed
_THIN = 1.5  # width of a band, in deviations of blur, up to which its dot alone is measured
_POSSIBLE = 0.01  # confidence of a doubtful reading, from which black is lifted otherwise
_SHIFTS = np.arange(-2.4, 2.41, 0.4)  # of edges, that are tried, px


def read_bands(
    gray: np.ndarray,
    dots: Fit,
    family: RingPrint,
    prior: Prior = NOTHING_KNOWN,
    least: np.ndarray | None = None,
) -> Hypotheses:
    """Read the bands about dots, and refine dot and band together: one hypothesis of each dot.

    Words whose log odds against anything, see `Words.seen`, are not above `least`, shape (k,), are
    not asked for: their dots may be left unread.
    """
    unread = Hypotheses.unread(dots, family)
    least = np.full(len(dots.frames), -np.inf) if least is None else least
    for part in _parts(dots):
        drafted, drafts = _drafts(gray, dots.select(part), family, prior)
        found = _read_part(gray, drafts, family, prior, least[part][drafted])
        read = found.words > 0
        unread = unread.replaced(part[drafted[read]], found.select(read))
    return unread


def read_printed(
    gray: np.ndarray, printed: Fit, family: RingPrint, prior: Prior = NOTHING_KNOWN
) -> Hypotheses:
    """Read the bands of targets whose printed dots are known, and by how much edges have shifted.

    These are as good as drafts: bands are read once. There is one hypothesis of each target.
    """
    parts = (printed.select(part) for part in _parts(printed))
    read = [_read_part(gray, part, family, prior) for part in parts]
    return Hypotheses.joined([Hypotheses.unread(NO_FITS, family), *read])


def _parts(dots: Fit) -> Iterator[np.ndarray]:
    """Yield the indices of as many dots as are read at a time."""
    every = np.arange(len(dots.frames))
    for start in range(0, len(every), PART):
        yield every[start : start + PART]


def _drafts(
    gray: np.ndarray, dots: Fit, family: RingPrint, prior: Prior
) -> tuple[np.ndarray, Fit]:
    """Return which dots, indices (n,), have a band that may be a word, and fits with it."""
    polar = polar_images(gray, dots, family.band, family.bits * PER_SECTOR)
    polar = on_dark_ground(polar, family.band)
    growth = best_growth(polar, family.band, prior)
    edges = edge_evidence(polar, 1 - growth, growth, family.band, SHARES)
    words = decode(edges, _overhang(growth, family), family, prior.expected, draft=True)
    drafted = np.flatnonzero(_mean_odds(words, edges.weight) > _least_odds(family))
    if not drafted.size:
        return drafted, NO_FITS
    edges, growth = edges.select(drafted), growth[drafted]
    printed = dots.select(drafted)
    printed = replace(printed, frames=frame.scaled(printed.frames, 1 - growth))
    # In the frame of the printed dot, the same growth is a larger share.
    some = polar.select(drafted), edges, words.select(drafted)
    growth = growth / (1 - growth)
    words = _settled(gray, printed, *some, growth, family, prior.expected, draft=True)
    good = _mean_odds(words, edges.weight) > _least_odds(family)
    if not good.any():
        return drafted[good], NO_FITS
    drafted, growth = drafted[good], growth[good]
    printed, words = printed.select(good), words.select(good)
    fit = _joint_fit(gray, printed, words, PER_SECTOR // 2, 1, family)
    return drafted, _by_dot(fit, printed, growth, _thin(printed, growth, family))


def _read_part(
    gray: np.ndarray,
    fit: Fit,
    family: RingPrint,
    prior: Prior,
    least: np.ndarray | float = -np.inf,
) -> Hypotheses:
    """Return what bands are read as in the frames of their drafts; see `read_bands`.

    Black marks in uneven light are read as they are, and those in doubt with the black of prints.
    Ground that is darker than ink is in prints is uneven by light or by sharpening. Bright targets
    on it that are in doubt, or in uneven light, are read without a lift of black as well, and then
    nearly in gray values. Lifted black hides marks in shadow: what it shows is less sure
    by the margin of another word that was read before.
    """
    ratio = lift_ratio(gray, fit, family.band)
    read = _read_lifted(gray, fit, family, prior, least, ratio)

    def again(read: Hypotheses, some: np.ndarray, lift: float) -> Hypotheses:
        """Return what is read, some of it with another lift of black where that makes it surer."""
        if not some.size:
            return read
        before = read.select(some)
        other = _read_lifted(gray, fit.select(some), family, prior, -np.inf, lift)
        if lift > AS_IT_IS:
            other = _against(before, other, family)
        surer = other.certain | (other.confidence > before.confidence)
        return read.replaced(some[surer], other.select(surer))

    doubtful = ~read.certain & (read.confidence >= _POSSIBLE)
    read = again(read, np.flatnonzero(doubtful & (ratio == AS_IT_IS)), PRINTED)
    bright = (fit.polarity < 0) & (read.confidence >= _POSSIBLE)
    black = np.flatnonzero(bright & (fit.contrast < BLACK))
    if black.size:
        uneven = in_uneven_light(gray, fit.frames[black], family.band)
        read = again(read, black[uneven | ~read.certain[black]], AS_IT_IS)
    some = np.flatnonzero(bright & ~read.certain & (fit.contrast < PRINTED))
    return again(read, some, NEARLY_LINEAR)


def _against(before: Hypotheses, read: Hypotheses, family: RingPrint) -> Hypotheses:
    """Return what is read, less sure by the margin of what was read before where that differs."""
    both = np.flatnonzero((before.words > 0) & (read.words > 0))
    known, ids = (canonical(of.words[both], family)[1] for of in (before, read))
    differ = both[ids != known]
    margin = read.margin.copy()
    margin[differ] -= np.maximum(before.margin[differ], 0)
    return rated(replace(read, margin=margin))


def _read_lifted(
    gray: np.ndarray,
    fit: Fit,
    family: RingPrint,
    prior: Prior,
    least: np.ndarray | float,
    ratio: np.ndarray | float,
) -> Hypotheses:
    """Return the same with black lifted to a ratio of ink and paper, see `black_lift`."""
    unread = Hypotheses.unread(fit, family)
    if not len(fit.frames):
        return unread
    # A dot and its band are not printed and grown alike: each is read where it was seen.
    printed = np.abs(fit.proportion - 1) < _PROPORTION
    bands = replace(fit, frames=frame.scaled(fit.frames, np.where(printed, fit.proportion, 1)))
    growth = fit.polarity * fit.edge_shift / bands.size
    angles = family.bits * PER_SECTOR
    polar = polar_images(gray, bands, family.band, angles, ratio=ratio, covers=True)
    polar = on_dark_ground(polar, family.band, fit.share >= ENOUGH)
    edges = edge_evidence(polar, np.ones(len(growth)), growth, family.band, SHARES)
    words = decode(edges, _overhang(growth, family), family, prior.expected)
    # What is seen against anything is that of edges alone, whatever else there is.
    enough = _of_reading(words.seen, words, edges.weight) > _least_odds(family)
    asked = np.flatnonzero(enough & (words.seen > least))
    if not asked.size:
        return unread
    if asked.size < enough.size:
        growth, fit, bands = growth[asked], fit.select(asked), bands.select(asked)
        polar, edges, words = polar.select(asked), edges.select(asked), words.select(asked)
    overhang = _overhang(growth, family)
    words = _settled(gray, bands, polar, edges, words, growth, family, prior.expected, draft=False)
    words = with_ends(polar, words, overhang, family)
    words = replace(words, unlike=unlike_print(polar, words, growth, overhang, family))
    good = _mean_odds(words, edges.weight) > _least_odds(family)
    if not good.any():
        return unread
    drafts, words, growth = fit.select(good), words.select(good), growth[good]
    fit = _joint_fit(gray, drafts, words, PER_SECTOR, 2, family)
    fit = _by_dot(fit, drafts, growth, _thin(drafts, growth, family))
    return unread.replaced(asked[good], rated(Hypotheses.of(fit, words, family)))


def best_growth(
    polar: PolarImages, band: tuple[float, float], prior: Prior = NOTHING_KNOWN
) -> np.ndarray:
    """Return by how much the colour of dots has grown on all edges, so that these fit best, (k,).

    In the dot radii of the image; a dot that is seen with radius 1 was printed with less.
    """
    reach, plate = polar.reach[:, ::2], polar.plate[:, ::2]
    half = replace(polar, gray=polar.gray[..., ::2].copy(), reach=reach, plate=plate)
    tried, looks = shifted_evidence(half, _SHIFTS, band)
    paper, ink = looks[:, :, 0], looks[:, :, 1]
    # Any ground is as even as paper somewhere, but only a band has ink.
    score = np.maximum(ink - np.maximum(paper, 0), 0).sum(axis=2)
    unusual = (np.multiply.outer(polar.polarity, _SHIFTS) - prior.shift) / prior.deviation
    best = (score - 0.5 * unusual**2).argmax(axis=1)
    return tried[np.arange(len(best)), best]


def _settled(
    gray: np.ndarray,
    targets: Fit,
    polar: PolarImages,
    edges: Evidence,
    words: Words,
    growth: np.ndarray,
    family: RingPrint,
    expected: frozenset[int],
    *,
    draft: bool,
) -> Words:
    """Return the words of targets, by all evidence where edges alone leave a doubt.

    Targets are in the frames of their printed dots, the unit of the growth of their colour, (k,).
    In a draft, only other words are a reason to doubt.
    """
    doubtful = words.margin < CLEAR
    if not draft:
        doubtful |= (words.coded < -DOUBT) | words.hidden.any(axis=1)
        doubtful |= edges.covered.any(axis=(1, 2))
    some = np.flatnonzero(doubtful)
    if not some.size:
        return words
    targets, polar, edges = targets.select(some), polar.select(some), edges.select(some)
    inner, outer = family.band
    of_gap, of_band = 1 + (inner - 1) * GAP, inner + (outer - inner) * DEPTHS
    of_gap, beyond = (of[clear_of(of, family.circles)] for of in (of_gap, outer + MARGIN))
    radii = np.concatenate([DOT, of_gap, of_band, beyond])
    angles = angles_of(family.bits * PER_SECTOR)
    levels, _ = on_circles(gray, targets.frames, angles, radii, polar.lift)
    of_target = targets.frames, polar.lift, angles, radii
    of_print = family.band, family.circles, polar.rim(outer), polar.contrast
    light, spread = predicted_light(gray, *of_target, *of_print)
    growth = growth[some]
    of_levels = level_evidence(polar, levels, light, spread, radii, growth, family.band, SHARES)
    evidence = edges.plus(of_levels)
    overhang = _overhang(growth, family)
    of_all = decode(evidence, overhang, family, expected, draft=draft)
    hidden = of_all.hidden | (polar.reach < of_band[0])
    # What speaks against no target is that of edges, so that all targets compare.
    of_edges = words.select(some)
    of_all = replace(
        of_all,
        hidden=hidden,
        seen=of_edges.seen,
        typical=of_edges.typical,
        outer=of_edges.outer,
    )
    return words.replaced(some, of_all)


def _thin(printed: Fit, growth: np.ndarray, family: RingPrint) -> np.ndarray:
    """Return which bands are so thin that blur moves their edges apart, indices.

    The growth of the dots' colour, (k,), is in radii of the printed dots.
    """
    inner, outer = family.band
    width = (outer - inner + 2 * growth) * printed.size
    return np.flatnonzero(width < _THIN * printed.blur)


def _by_dot(fit: Fit, printed: Fit, growth: np.ndarray, which: np.ndarray) -> Fit:
    """Return joint fits, some of them with the frames of printed dots alone, and their growth."""
    shift = printed.polarity * growth * printed.size
    known = np.isfinite(printed.covariance)
    alone = replace(
        printed,
        edge_shift=shift,
        share=fit.share,
        deviation=fit.deviation,
        proportion=np.ones(len(shift)),
        covariance=np.where(known, printed.covariance, fit.covariance),
    )
    return fit.replaced(which, alone.select(which))


def _least_odds(family: RingPrint) -> float:
    """Return the mean log odds of a reading from which a band may show a word."""
    return HOPEFUL * min(1.0, least_marked(family) / FEW_MARKS)


def _mean_odds(words: Words, weight: np.ndarray) -> np.ndarray:
    """Return the log odds of words against no target for a reading, shape (k,)."""
    return _of_reading(np.minimum(words.marked, words.seen), words, weight)


def _of_reading(odds: np.ndarray, words: Words, weight: np.ndarray) -> np.ndarray:
    """Return log odds of words, shape (k,), for a reading."""
    return odds / (weight * words.hidden.shape[1])


def _overhang(growth: np.ndarray, family: RingPrint) -> np.ndarray:
    """Return by how many angles grown arcs of ink are longer at either end, shape (k,)."""
    middle = sum(family.band) / 2
    return growth / middle * (family.bits * PER_SECTOR / (2 * np.pi))


def _joint_fit(
    gray: np.ndarray, start: Fit, words: Words, per_sector: int, rounds: int, family: RingPrint
) -> Fit:
    """Return the joint fit of dots and of the marks of their words."""
    circles = target_circles(words.words, words.starts, start.polarity, per_sector, family)
    return fit_circles(
        gray,
        start.frames,
        circles,
        reach=reach_of(family),
        projective=True,
        rounds=rounds,
        blur=start.blur,
        covariances=rounds > 1,
        uneven=True,
    )
