"""Where arcs of ink end: at the borders of sectors, if they are marks of a code.

The readings of a band find a border to one angle. The share of the band beside it that is dark
tells its place to a small part of that, whatever the blur. Arcs of any length, and those of
another number of sectors, end anywhere. A lens that bends a target moves its band beside its dot,
and the ends by a sine of their direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ahf_ros.families.ring.decoding import Words, bits_at
from ahf_ros.families.ring.likelihood import normal
from ahf_ros.families.ring.polar import DEPTHS, PolarImages
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.robust import fit_linear, median

_BESIDE = 3  # angles on either side of a border
_CONTRAST = 0.5  # share of the step of a mark, from which a border is seen
_ERROR, _PIXELS = 0.15, 0.4  # standard deviation of the place of a border, angles and px
_ANYWHERE = 0.1  # share of borders that light moves
_UNSEEN = 2.3  # price of an end that is not seen, as of one that is anywhere
_MOVED = 8.0  # price of a band that is not concentric with its dot
_ROBUST = 0.5  # distance of ends, angles, of which a quarter is left
_RARE = 12.0  # log odds of a cover against a word that no family has


def with_ends(polar: PolarImages, words: Words, overhang: np.ndarray, family: RingPrint) -> Words:
    """Return words with the evidence of where their arcs end, and the margin that this leaves.

    `overhang`, shape (k,), is by how many angles ink is longer at either end than its sectors. A
    word that no family has competes with words that need a cover.
    """
    inner, outer = family.band
    radii = inner + (outer - inner) * np.tile(DEPTHS, (len(overhang), 1))
    levels = polar.at(radii).mean(axis=1)
    odds, beside, unseen = _ends(polar, levels, words, overhang, family)
    some, margin = np.flatnonzero(words.other != words.words), words.margin.copy()
    if some.size:
        looks = words.select(some).as_they_look()
        other, _, unseen_of_other = _ends(
            polar.select(some), levels[some], looks, overhang[some], family
        )
        ahead = other - odds[some] - _UNSEEN * (unseen_of_other - unseen[some])
        margin[some] = np.minimum(margin[some], _RARE - looks.ahead - ahead)
    coded = words.coded + odds + np.maximum(words.beside + beside - odds - _MOVED, 0)
    return replace(words, margin=margin, coded=coded)


def _ends(
    polar: PolarImages, levels: np.ndarray, words: Words, overhang: np.ndarray, family: RingPrint
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the log odds that arcs end where the sectors do, against anywhere near, shape (k,).

    `levels` are the mean gray values across the band, shape (k, m), at all angles. With the odds
    come those of a band beside its dot, and the numbers of ends that nothing hides and that are
    not seen.
    """
    count, (inner, outer) = words.hidden.shape[1], family.band
    phases = np.rint(words.starts * count / (2 * np.pi)).astype(int)
    bits = bits_at(words.words, phases, count // family.bits, family)
    ends = bits != np.roll(bits, 1, axis=1)
    rows, places = np.nonzero(ends)
    about = levels[rows[:, None], (places[:, None] + np.arange(-_BESIDE, _BESIDE)) % count]
    begins = bits[rows, places]
    about = np.where(begins[:, None], about, about[:, ::-1])  # paper first
    paper, ink = np.log(about[:, [0, -1]] + LOG_OFFSET).T
    seen = np.abs(paper - ink) > _CONTRAST * np.abs(np.log(polar.contrast[rows]))
    rows, places, about, begins = rows[seen], places[seen], about[seen], begins[seen]
    paper, ink = about[:, :1], about[:, -1:]
    bright = np.clip((about - ink) / (paper - ink), 0, 1).sum(axis=1)
    away = np.zeros(words.hidden.shape)
    known = np.zeros(away.shape, bool)
    away[rows, places] = np.where(begins, 1, -1) * (bright - _BESIDE + overhang[rows])
    known[rows, places] = True
    away -= median(away, known, 0.0)[:, None]  # frames may be turned by a part of an angle
    error = np.hypot(_ERROR, _PIXELS * count / (np.pi * (inner + outer) * polar.size))[:, None]
    odds = _in_place(away, error, known)
    beside = odds.copy()
    off = np.flatnonzero(_in_place(0 * away, error, known) > odds)
    if off.size:
        beside[off] = _in_place(_aside(away[off], known[off]), error[off], known[off])
    steps = range(-_BESIDE, _BESIDE + 1)
    hidden = np.logical_or.reduce([np.roll(words.hidden, step, axis=1) for step in steps])
    unseen = np.count_nonzero(ends & ~hidden & ~known, axis=1)
    return odds, beside, unseen


def _aside(away: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return how far known ends are away from those of bands beside their dots, all (k, m)."""
    angles = 2 * np.pi * np.arange(away.shape[1]) / away.shape[1]
    sides = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=1)
    return fit_linear(away, known.astype(float), sides, _ROBUST)[1]


def _in_place(away: np.ndarray, error: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the log odds that known ends are in place, against anywhere near, shape (k,).

    From how far away they are, (k, m), and the error of that.
    """
    odds = np.log((1 - _ANYWHERE) * normal(away, error) * _BESIDE + _ANYWHERE)
    return np.asarray((odds * known).sum(axis=1))
