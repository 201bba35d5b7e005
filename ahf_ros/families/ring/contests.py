"""How hypotheses that contradict each other are settled, and what others say of each."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from ahf_ros.families.claims import Rivals, leading, owners, sole_owners, surer, within
from ahf_ros.families.ring.confidence import COVERED
from ahf_ros.families.ring.decoding import CLEAR
from ahf_ros.families.ring.families import decoded
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.rivals import has_all
from ahf_ros.vision import frame
from ahf_ros.vision.shape_votes import NEIGHBOURS

_CLEARLY = 2.0  # times the evidence of another claim to the same dot
_FOREIGN = 10.0  # log odds of arcs of any length against a word, which is none then
_OTHER_COLOUR = 0.2  # of a foreign band, that a target of the other colour counts for
_OF_LIGHT = 0.2  # of a foreign band, that one counts for whose edges are no ellipses
_BY_CHANCE = 3  # places in which foreign bands may show one word by chance
_CODED = 5.0  # odds of words against arcs of any length, before any is read
_OVERLAP = 0.92  # of the radii of two targets, at which the paper of one hides marks of the other
_SHEAR = 0.5  # ln of axes, by which a shape differs from those of all targets beside it
_ODD = 10.0  # odds against a target in another shape than those beside it


def among_others(hypotheses: Hypotheses) -> Hypotheses:
    """Return hypotheses of an image, less certain where it shows bands of no family that is read.

    Targets of one image share a family. Whole bands that arcs of any length explain better than
    words, and targets that do not look like their print are foreign. Among these a word is one by
    chance, unless more targets share its family and its colour, which most targets of an image do,
    also by words of a family of which its own has all; and it is arcs of any length, unless it
    explains its band better. What is not certain among these speaks for no other word of its
    family. Targets that are close to each other have much the same shape, which a word that is one
    by chance has not.

    What has one word in many places is no print, but light or letters that repeat themselves: a
    word speaks for others once, and against them as often as chance might read it. Bands whose
    edges are no ellipses are mostly light as well, and speak against words a little.
    """
    arcs = (hypotheses.coded < -_FOREIGN) & hypotheses.in_place
    prints = arcs & hypotheses.exact | (hypotheses.unlike > COVERED)
    foreign = np.where(prints, 1.0, _OF_LIGHT * arcs)
    odd = np.where(_odd(hypotheses), _ODD, 1.0)
    codes, left = decoded(hypotheses)[1], hypotheses
    while True:
        confidence = _among(hypotheses, codes, left, foreign * ~left.certain, odd)
        among = replace(hypotheses, confidence=confidence)
        if np.array_equal(among.certain, left.certain):
            return among
        left = among


def _among(
    hypotheses: Hypotheses,
    codes: np.ndarray,
    likely: Hypotheses,
    foreign: np.ndarray,
    odd: np.ndarray,
) -> np.ndarray:
    """Return the confidence of hypotheses, by how likely each is and by foreign bands, (k,).

    `codes`, shape (k,), are canonical code words, `foreign` says for how many foreign bands each
    counts, and `odd` are the odds against the shapes.
    """
    left = hypotheses.confidence.copy()
    evidence = likely.certain * likely.confidence
    families = list(dict.fromkeys(hypotheses.families))
    for code, sign in product(families, (1, -1)):
        of_family, of_colour = hypotheses.families == code, hypotheses.polarity == sign
        has_words = np.isin(hypotheses.families, [it for it in families if has_all(code, it)])
        own = of_family & of_colour
        sure = hypotheses.confidence[own]
        which = np.unique(codes[own], return_inverse=True)[1]
        others = np.minimum(np.bincount(which, foreign[own]), _BY_CHANCE).sum()
        unlike = _OTHER_COLOUR * evidence[has_words & ~of_colour].sum()
        alike = _of_other_words(codes, evidence * (has_words & of_colour))[own] + 0.5
        by_chance = np.maximum((others + unlike + 0.5) / alike, 1) * odd[own]
        as_arcs = others / alike * np.exp(-np.maximum(hypotheses.coded[own], 0)) / _CODED
        left[own] = sure / (1 + (1 - sure) * (by_chance - 1) + sure * as_arcs)
    return left


def _of_other_words(codes: np.ndarray, evidence: np.ndarray) -> np.ndarray:
    """Return the evidence of all words but that of each, which is the best of a word, (k,)."""
    best, which = np.zeros(len(codes)), np.unique(codes, return_inverse=True)[1]
    np.maximum.at(best, which, evidence)
    return best.sum() - best[which]


def _odd(hypotheses: Hypotheses) -> np.ndarray:
    """Return whether certain hypotheses have another shape than all those beside, bool, (k,)."""
    odd, certain = np.zeros(len(hypotheses.frames), bool), np.flatnonzero(hypotheses.certain)
    if len(certain) <= NEIGHBOURS:
        return odd
    frames = hypotheses.frames[certain]
    beside = frame.nearest(frames, frames, NEIGHBOURS + 1)[:, 1:]  # the first one is itself
    odd[certain] = frame.shears(frames, frames[beside]).min(axis=1) > _SHEAR
    return odd


def resolve(hypotheses: Hypotheses, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which hypotheses to keep, and which of these stay certain, bool, shape (k,) each.

    They come in the order of their confidence; `ids` are equal where words are the same. The best
    one of a dot is kept. Dots on the band of a certain target are its sectors and are dropped.
    Certain stays what neither another reading of its dot, nor a target whose band overlaps, nor
    another claim to its ID comes near to. Readings of a dot are compared against anything and
    against bare paper: where only one of them knows the levels of dot and paper, the latter of its
    log odds are much larger, whichever is right.
    """
    order = np.arange(len(ids))
    on_it = on_targets(hypotheses, hypotheses.certain)

    def against(of: np.ndarray) -> np.ndarray:
        return on_it(of) & (ids != ids[of, None]) & (order > of[:, None])

    kept = owners(len(ids), on_it)
    ahead = (
        leading(odds, hypotheses.certain, against, _CLEARLY, CLEAR)
        for odds in (hypotheses.seen, hypotheses.marked)
    )
    certain = kept & np.any([*ahead], axis=0)
    sure = 1 / (1 - hypotheses.confidence + np.finfo(float).eps)
    certain = surer(sure, certain, overlapping(hypotheses))
    return kept, sole_owners(hypotheses.confidence, certain, lambda of: ids == ids[of, None])


def on_targets(hypotheses: Hypotheses, certain: np.ndarray) -> Rivals:
    """Return what lies on the dot of a hypothesis, or on the band of a certain one."""
    reach = np.where(certain, hypotheses.reach, frame.ellipse_axes(hypotheses.frames)[0])
    return within(hypotheses.frames, reach)


def overlapping(hypotheses: Hypotheses) -> Rivals:
    """Return of which hypotheses the bands overlap that of one.

    There the paper of one target lies on that of the other. White paper on white paper may hide
    marks without a trace, so that only the one on top is certain, which is the surer one.
    """
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    outer = major * np.array([code.band_outer for code in hypotheses.families])
    centres = np.column_stack([hypotheses.frames[:, :2, 2], np.ones(len(major))])

    def overlapping(of: np.ndarray) -> np.ndarray:
        x, y, scale = np.linalg.solve(hypotheses.frames[of], centres.T[None]).swapaxes(0, 1)
        distance = np.hypot(x, y) / np.abs(scale) * major[of, None]
        return np.asarray(distance < _OVERLAP * (outer + outer[of, None]))

    return overlapping
