"""The competition of families for the bands about dots.

The family that most of the clearest dots have reads all dots. The others read only those that are
not certain yet and whose surroundings are those of a target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ahf_ros.codes.ring import FAMILY_NAMES, Family, family
from ahf_ros.detectors.ring.confidence import IN_LIGHT
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.other_prints import SHARP, attainable_sharpness
from ahf_ros.detectors.ring.reading import PASSES, read_bands
from ahf_ros.detectors.ring.surroundings import designs, likely_targets
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit

PART = 256
"""Dots read at a time, which bounds the memory."""

_CLEAREST = 48  # dots among which targets are looked for that tell which family comes first
_READ = 8  # of these, that are read
_MANY = 5  # of these, most of whose words settle it however blunt they are
_MOST = 0.8  # of those read, whose words settle it
_SHARPEST = 5.1  # sharpness of edges that are those of no other word
_BLUNTER = 0.8  # than usual, from which a certain word is contested by other families
_SHARPER = 0.2  # than the word of another family, to be the word of a dot
_LEAST_SHARE = 0.01  # of edges in their places, instead of none
_UNEXPLAINED = np.log1p(3.5)  # evidence for arcs of any length, that may be other words
_LIKELY = 0.2  # probability of a target, for a dot to be read as other families, too


def by_clear_dots(gray: np.ndarray, dots: Fit, families: Sequence[Family]) -> list[Family]:
    """Return families in the order of how many of the clearest targets are theirs.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Fit
    families : sequence of Family
    """
    ordered = list(families)
    if len(families) == 1 or not len(dots.frames):
        return ordered
    clearest = np.argsort(-dots.share * (1 - dots.contrast), kind='stable')
    for count in (_CLEAREST, len(clearest)):  # all of them where light makes clear dots, too
        ordered, some = _by_words(gray, dots.select(clearest[:count]), ordered)
        if some:
            break
    return ordered


def _by_words(
    gray: np.ndarray, dots: Fit, families: Sequence[Family]
) -> tuple[list[Family], bool]:
    """Return families in the order of how many words are theirs, and whether there are any."""
    likely = {code.band: likely_targets(gray, dots, code) for code in designs(families)}
    best = np.max(list(likely.values()), axis=0)
    which = np.argsort(-best, kind='stable')[:_READ]
    which = which[best[which] >= _LIKELY]
    # Families of the print that is seen come first, as they are likely to settle it.
    ordered = sorted(families, key=lambda code: -likely[code.band][which].sum())
    sharp = np.zeros((len(ordered), len(which)))
    for index, code in enumerate(ordered if which.size else ()):
        read, of_dot = read_bands(gray, dots.select(which), code)
        np.maximum.at(sharp[index], of_dot, np.where(read.certain, read.sharpness, 0.0))
        of_print = index + 1 < len(ordered) and ordered[index + 1].band == code.band
        enough = _SHARPEST if of_print else SHARP  # where other words, or prints, may be as sharp
        if len(which) >= _MANY:
            enough = 0.0  # a foreign family never reads so many
        if (sharp > enough).any(axis=0).sum() > _MOST * len(which):
            break
    won = np.bincount(sharp.argmax(axis=0)[sharp.any(axis=0)], minlength=len(ordered))
    return [ordered[index] for index in np.argsort(-won, kind='stable')], bool(won.any())


def read_families(
    gray: np.ndarray,
    dots: Fit,
    families: Sequence[Family],
    expected: frozenset[int] = frozenset(),
) -> Hypotheses:
    """Read the bands about dots as words of several families.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Fit
        Of k dots.
    families : sequence of Family
        The first one reads all dots, the others those that are not certain yet.
    expected : frozenset of int
        IDs that are likely to be there; all are alike where it is empty.

    Returns
    -------
    Hypotheses
        At least one of each dot.
    """
    first, *others = families
    found = _against_other_words(gray, dots, _read(gray, dots, first, expected), families)
    if not others:
        return found
    dots = dots.select(~_settled(dots, found))
    likely = {code.band: likely_targets(gray, dots, code) for code in designs(others)}
    parts = [found]
    for code in others:
        of_print = likely[code.band]
        best_first = np.argsort(-of_print, kind='stable')[: (of_print >= _LIKELY).sum()]
        # Where the likeliest dots are not certain, it is light that hides the first family.
        for some in (best_first[:_READ], best_first[_READ:]):
            if not len(some):
                break
            read = _read(gray, dots.select(some), code, expected)
            parts.append(read.select(read.words > 0))
            if not read.certain.any():
                break
    return _contested(Hypotheses.joined(parts))


def _against_other_words(
    gray: np.ndarray, dots: Fit, found: Hypotheses, families: Sequence[Family]
) -> Hypotheses:
    """Return hypotheses of which none is certain where a family that is not read agrees better.

    Families of one print differ in the number of sectors. What a word leaves unexplained shows
    where the band may be one of theirs; `of_other_prints` tells other prints. Where nearly all
    edges are in their places, no other word can agree clearly better.
    """
    unexplained = np.where(found.certain, found.features[:, IN_LIGHT], 0.0)
    doubtful = np.argsort(-unexplained, kind='stable')[: (unexplained > _UNEXPLAINED).sum()]
    if not len(doubtful):
        return found
    read = {code.name for code in families}
    others = [family(name) for name in FAMILY_NAMES if name not in read]
    rivals = [code for code in others if code.band == families[0].band]
    better = attainable_sharpness(found.sharpness, np.maximum(found.share, _LEAST_SHARE))
    contestable = better > found.sharpness + _SHARPER / 2
    parts = [found]
    contested = found
    # Where the rivals contest none of the most doubtful words, the family is right.
    for some in (doubtful[:_READ], doubtful[_READ:]):
        some = some[contestable[some]]
        if not len(some):
            break
        away = found.frames[some, None, :2, 2] - dots.frames[:, :2, 2]
        nearest = dots.select(np.hypot(away[..., 0], away[..., 1]).argmin(axis=1))
        refined = replace(nearest, frames=found.frames[some])
        contested, by_rivals = _against_rivals(gray, refined, rivals, parts)
        if contested.certain[some].all():
            break
        parts += by_rivals
    return contested


def _against_rivals(
    gray: np.ndarray, dots: Fit, rivals: Sequence[Family], parts: Sequence[Hypotheses]
) -> tuple[Hypotheses, list[Hypotheses]]:
    """Return the first part, contested by the others and by rivals, and what rivals read."""
    # Whether a rival is of another print takes time to see, and matters only if it contests.
    for other_prints in (False, True):
        again = partial(_read, passes=PASSES[-1:], other_prints=other_prints, hidden=False)
        read = [again(gray, dots, code) for code in rivals]
        contested = _contested(Hypotheses.joined([*parts, *read]))
        contested = contested.select(slice(len(parts[0].words)))
        if np.array_equal(contested.certain, parts[0].certain):
            break
    return contested, read


def _read(
    gray: np.ndarray,
    dots: Fit,
    code: Family,
    expected: frozenset[int] = frozenset(),
    passes: Sequence[tuple[int, int]] = PASSES,
    other_prints: bool = True,
    hidden: bool = True,
) -> Hypotheses:
    parts = []
    for start in range(0, max(len(dots.frames), 1), PART):
        part = dots.select(slice(start, start + PART))
        read, _ = read_bands(gray, part, code, expected, passes, other_prints, hidden)
        parts.append(read)
    return Hypotheses.joined(parts)


def _settled(dots: Fit, found: Hypotheses) -> np.ndarray:
    """Return which dots are middles of certain targets, or sectors of their bands, shape (k,)."""
    certain = found.select(found.certain)
    settled = np.zeros(len(dots.frames), bool)
    if not len(certain.words):
        return settled
    usual = float(np.median(certain.sharpness)) - _BLUNTER
    certain = certain.select(certain.sharpness >= usual)
    for (x, y), reach in zip(certain.frames[:, :2, 2], certain.reach, strict=True):
        settled |= np.hypot(dots.frames[:, 0, 2] - x, dots.frames[:, 1, 2] - y) < reach
    return settled


def _contested(hypotheses: Hypotheses) -> Hypotheses:
    """Return hypotheses of which none is certain where another family agrees clearly better."""
    confidence = hypotheses.confidence.copy()
    certain = np.flatnonzero(hypotheses.certain)
    centres, families = hypotheses.frames[:, :2, 2], hypotheses.families
    _, minor, _ = frame.ellipse_axes(hypotheses.frames)
    for index in certain:
        same = np.hypot(*(centres[certain] - centres[index]).T) < minor[index]
        rivals = certain[same & (families[certain] != families[index])]
        if (hypotheses.sharpness[rivals] > hypotheses.sharpness[index] + _SHARPER).any():
            confidence[index] = 0.0
    return replace(hypotheses, confidence=confidence)
