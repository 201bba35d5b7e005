"""Hypotheses on the dots of an image, and how contradicting ones are resolved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.claims import Rivals, leading, owners
from ahf_ros.detectors.ring.confidence import CERTAIN, COVERED, confidence, features
from ahf_ros.detectors.ring.decoding import Words
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import Fit

_CLEARLY = 2.0  # times the evidence of another claim to the same ID or dot
_CLEAR = 5.0  # log odds of a word against arcs of any length, up to which others may be right
_FOREIGN = 10.0  # log odds of arcs of any length against a word, which is none then
_ROUND = 0.6  # share of the edges of a word that are in their place, where there is a band
_CODED = 5.0  # odds of words against arcs of any length, before any is read
_OVERLAP = 0.92  # of the radii of two targets, at which the paper of one hides marks of the other
_ON_TOP = 3.0  # times as sure of its word as of what lies below it


@dataclass(frozen=True, slots=True)
class Hypotheses(ArrayRecord):
    """k dots, and what their bands were read as.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were measured where they are expected.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of these edges, dot radii.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px of the image that they were measured in.
    edge_shift : ndarray of float64, shape (k,)
        By how much what is dark has grown on all edges, px of that image.
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    words : ndarray of int64, shape (k,)
        In the rotation read; 0 where there is none.
    starts : ndarray of float64, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    margin, marked, coded, ends, seen, sharp, unlike : ndarray of float64, shape (k,)
        Log odds of the word and looks of its print, see `ahf_ros.detectors.ring.decoding.Words`.
    hidden : ndarray of float64, shape (k,)
        Share of the band that something covers.
    families : ndarray of Family, shape (k,)
        Those of the words.
    confidence : ndarray of float64, shape (k,)
        Probability that the word is right.
    """

    frames: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    blur: np.ndarray
    edge_shift: np.ndarray
    polarity: np.ndarray
    words: np.ndarray
    starts: np.ndarray
    margin: np.ndarray
    marked: np.ndarray
    coded: np.ndarray
    ends: np.ndarray
    seen: np.ndarray
    sharp: np.ndarray
    unlike: np.ndarray
    hidden: np.ndarray
    families: np.ndarray
    confidence: np.ndarray

    @property
    def certain(self) -> np.ndarray:
        """Whether words are certain enough to be reported, ndarray of bool, shape (k,)."""
        certain: np.ndarray = self.confidence >= CERTAIN
        return certain

    @property
    def clear(self) -> np.ndarray:
        """Whether no other family may explain the bands of certain words better, shape (k,)."""
        clear: np.ndarray = self.certain & (self.coded > _CLEAR)
        return clear

    @property
    def shift(self) -> np.ndarray:
        """Shifts of edges where a word was read, NaN elsewhere, px, float64, shape (k,)."""
        return np.where(self.words > 0, self.edge_shift, np.nan)

    @property
    def reach(self) -> np.ndarray:
        """Radii of the targets with their bands, px, ndarray of float64, shape (k,)."""
        _, minor, _ = frame.ellipse_axes(self.frames)
        return minor * np.array([code.band_outer for code in self.families])

    def on_dots(self, others: Hypotheses) -> np.ndarray:
        """Return whether centres lie on the dots of others, ndarray of bool, shape (k,)."""
        away = self.frames[:, None, :2, 2] - others.frames[:, :2, 2]
        radii = frame.mean_radii(others.frames)
        return np.asarray((np.hypot(away[..., 0], away[..., 1]) < radii).any(axis=1))

    @staticmethod
    def of(fit: Fit, words: Words, family: Family) -> Hypotheses:
        """Return the hypotheses of words, and of the frames that were fitted to them."""
        read = Hypotheses(
            frames=fit.frames,
            covariance=fit.covariance,
            share=fit.share,
            deviation=fit.deviation / fit.size,
            blur=fit.blur,
            edge_shift=fit.edge_shift,
            polarity=fit.polarity,
            words=words.words,
            starts=words.starts,
            margin=words.margin,
            marked=words.marked,
            coded=words.coded,
            ends=words.ends,
            seen=words.seen,
            sharp=words.sharp,
            unlike=words.unlike,
            hidden=words.hidden.mean(axis=1),
            families=np.full(len(words.words), family, object),
            confidence=np.zeros(len(words.words)),
        )
        return replace(read, confidence=np.where(read.words > 0, confidence(features(read)), 0.0))

    @staticmethod
    def unread(dots: Fit, family: Family) -> Hypotheses:
        """Return dots without words."""
        return Hypotheses.of(dots, Words.none(len(dots.frames)), family)


def among_others(hypotheses: Hypotheses) -> Hypotheses:
    """Return hypotheses of an image, less certain where it shows bands of no family that is read.

    Targets of one image share a family. Whole bands that arcs of any length explain better than
    words, with ends anywhere, and targets that do not look like their print are foreign. Among
    these a word is one by chance, unless more targets share its family; and it is arcs of any
    length, unless it explains its band better. What is not certain among these speaks for no other
    word of its family.
    """
    arcs = (hypotheses.coded < -_FOREIGN) & (hypotheses.ends <= 0) & (hypotheses.share > _ROUND)
    arcs |= hypotheses.unlike > COVERED
    left = hypotheses
    while True:
        among = replace(hypotheses, confidence=_among(hypotheses, left, arcs & ~left.certain))
        if np.array_equal(among.certain, left.certain):
            return among
        left = among


def _among(hypotheses: Hypotheses, likely: Hypotheses, foreign: np.ndarray) -> np.ndarray:
    """Return the confidence of hypotheses, by how likely each is and by foreign bands, (k,)."""
    left = hypotheses.confidence.copy()
    for code in dict.fromkeys(hypotheses.families):
        own = hypotheses.families == code
        sure, others = hypotheses.confidence[own], foreign[own].sum()
        alike = (likely.certain * likely.confidence)[own]
        alike = alike.sum() - alike + 0.5
        by_chance = np.maximum((others + 0.5) / alike, 1)
        as_arcs = others / alike * np.exp(-np.maximum(hypotheses.coded[own], 0)) / _CODED
        left[own] = sure / (1 + (1 - sure) * (by_chance - 1) + sure * as_arcs)
    return left


def resolve(hypotheses: Hypotheses, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which hypotheses to keep, and which of these stay certain, bool, shape (k,) each.

    They come in the order of their evidence, the certain ones first; `ids` are equal where words
    are the same. The best one of a dot is kept. Dots on the band of a certain target are its
    sectors and are dropped. Certain stays what neither another reading of its dot, nor a target
    whose band overlaps, nor another claim to its ID comes near to.
    """
    seen, order = hypotheses.seen, np.arange(len(ids))
    on_it = on_targets(hypotheses, hypotheses.certain)

    def against(index: int) -> np.ndarray:
        return on_it(index) & (ids != ids[index]) & (order > index)

    kept = owners(len(ids), on_it)
    certain = kept & leading(seen, hypotheses.certain, against, _CLEARLY)
    sure = 1 / (1 - hypotheses.confidence + np.finfo(float).eps)
    certain = leading(sure, certain, _overlapping(hypotheses), _ON_TOP)
    return kept, leading(seen, certain, lambda index: ids == ids[index], _CLEARLY)


def on_targets(hypotheses: Hypotheses, certain: np.ndarray) -> Rivals:
    """Return what lies on the dot of a hypothesis, or on the band of a certain one."""
    reach = np.where(certain, hypotheses.reach, frame.ellipse_axes(hypotheses.frames)[0])
    centres = hypotheses.frames[:, :2, 2]
    return lambda index: np.hypot(*(centres - centres[index]).T) < reach[index]


def _overlapping(hypotheses: Hypotheses) -> Rivals:
    """Return of which hypotheses the bands overlap.

    There the paper of one target lies on that of the other. White paper on white paper may hide
    marks without a trace, so that only the one on top is certain, which is the surer one.
    """
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    outer = major * np.array([code.band_outer for code in hypotheses.families])
    centres = np.column_stack([hypotheses.frames[:, :2, 2], np.ones(len(major))])

    def overlapping(index: int) -> np.ndarray:
        x, y, scale = np.linalg.solve(hypotheses.frames[index], centres.T)
        distance = np.hypot(x, y) / np.abs(scale) * major[index]
        return np.asarray(distance < _OVERLAP * (outer + outer[index]))

    return overlapping
