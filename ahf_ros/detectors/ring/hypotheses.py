"""Hypotheses on the dots of an image, and how contradicting ones are resolved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring.confidence import (
    FEATURES,
    confidence,
    confidence_features,
    minimum_confidence,
)
from ahf_ros.detectors.ring.decoding import Readings
from ahf_ros.detectors.ring.other_prints import sharpness
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import Fit

_LIKELY = 0.5  # confidence from which a word tells where the edges of its band are
_CLEARLY = 2.0  # times the evidence of another claim to the same ID or dot
_OVERLAP = 0.92  # of the radii of two targets, at which the paper of one hides marks of the other
_ON_TOP = 1.25  # times the evidence of a target that is partly below it


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
    words : ndarray of int64, shape (k,)
        In the rotation read; 0 where no word is plausible.
    margin : ndarray of float64, shape (k,)
        Evidence over the best word of another ID, in units of ln.
    features : ndarray of float64, shape (k, n)
        What the confidence is computed from, see `confidence_features`.
    confidence : ndarray of float64, shape (k,)
        Probability that the word is right.
    families : ndarray of Family, shape (k,)
        Those of the words.
    sharpness : ndarray of float64, shape (k,)
        How well the edges agree with the word and the print, see `other_prints.sharpness`.
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    starts : ndarray of float64, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px of the image that they were measured in.
    """

    frames: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    words: np.ndarray
    margin: np.ndarray
    features: np.ndarray
    confidence: np.ndarray
    families: np.ndarray
    sharpness: np.ndarray
    polarity: np.ndarray
    starts: np.ndarray
    blur: np.ndarray

    @property
    def certain(self) -> np.ndarray:
        """Whether words are certain enough to be reported, ndarray of bool, shape (k,)."""
        certain: np.ndarray = self.confidence >= minimum_confidence(self.features)
        return certain

    @property
    def reach(self) -> np.ndarray:
        """Radii of the targets with their bands, px, ndarray of float64, shape (k,)."""
        _, minor, _ = frame.ellipse_axes(self.frames)
        return minor * np.array([code.band_outer for code in self.families])

    @staticmethod
    def unread(dots: Fit, family: Family) -> Hypotheses:
        """Return dots whose bands are not read."""
        count = len(dots.frames)
        words, nothing = np.zeros(count, np.int64), np.zeros(count)
        features = np.zeros((count, FEATURES))
        return Hypotheses(
            dots.frames,
            dots.covariance,
            dots.share,
            words,
            nothing,
            features,
            nothing,
            np.full(count, family, object),
            nothing,
            dots.polarity,
            nothing,
            dots.blur,
        )

    @staticmethod
    def read(readings: Readings, fit: Fit, dots: Hypotheses, foreign: np.ndarray) -> Hypotheses:
        """Return bands that are read, with the frames of dot and band where their word is likely.

        Parameters
        ----------
        readings : Readings
        fit : Fit
            Of dot and band.
        dots : Hypotheses
            The same dots, whose bands are not read.
        foreign : ndarray of bool, shape (k,)
            Whether the bands are of another print, so that no word is likely.
        """
        features = confidence_features(readings, fit)
        certainty = np.where(foreign, 0.0, confidence(features))
        likely = certainty >= _LIKELY
        every = Hypotheses(
            fit.frames,
            fit.covariance,
            fit.share,
            readings.words,
            np.maximum(readings.margin, readings.support),
            features,
            certainty,
            dots.families,
            sharpness(fit),
            fit.polarity,
            readings.start,
            fit.blur,
        )
        alone = dots.select(~likely)
        doubtful = replace(
            every.select(~likely),
            frames=alone.frames,
            covariance=alone.covariance,
            share=alone.share,
        )
        return every.replaced(~likely, doubtful)


def resolve_dots(
    hypotheses: Hypotheses, ids: np.ndarray, certain: np.ndarray, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Resolve which hypotheses on the same dot to keep.

    Parameters
    ----------
    hypotheses : Hypotheses
        In the order of their evidence, the best first.
    ids : ndarray of int, shape (k,)
        Equal where words are the same.
    certain : ndarray of bool, shape (k,)
    reach : ndarray of float64, shape (k,)
        Radii of the targets with their bands, px.

    Returns
    -------
    kept : ndarray of int
        Indices of the best hypothesis of each dot. Dots on the band of a certain target are its
        sectors and are dropped.
    uncontested : ndarray of bool, shape (k,)
        Whether a hypothesis is kept and no other reading of its dot comes near to it.
    """
    reach = np.where(certain, reach, frame.ellipse_axes(hypotheses.frames)[0])
    centres, margin = hypotheses.frames[:, :2, 2], hypotheses.margin
    uncontested = np.ones(len(ids), bool)
    kept: list[int] = []
    for index, centre in enumerate(centres):
        distance = np.hypot(*(centres[kept] - centre).T)
        same = [other for other, near in zip(kept, distance < reach[kept], strict=True) if near]
        if not same:
            kept.append(index)
        for other in same:
            if certain[index] and ids[index] != ids[other]:
                uncontested[other] &= margin[other] > _CLEARLY * margin[index]
    dropped = np.ones(len(ids), bool)
    dropped[kept] = False
    return np.array(kept, np.intp), uncontested & ~dropped


def resolve_overlaps(hypotheses: Hypotheses, certain: np.ndarray) -> np.ndarray:
    """Return which hypotheses are certain and below no other target, shape (k,).

    Where two bands overlap the paper of one target lies on that of the other. White paper on white
    paper may hide marks without a trace, so that only the one on top is certain. It is the one
    that agrees better with its word.

    Parameters
    ----------
    hypotheses : Hypotheses
    certain : ndarray of bool, shape (k,)
    """
    on_top = certain.copy()
    which = np.flatnonzero(certain)
    some = hypotheses.select(which)
    major, _, _ = frame.ellipse_axes(some.frames)
    outer = major * np.array([code.band_outer for code in some.families])
    centres = np.column_stack([some.frames[:, :2, 2], np.ones(len(which))])
    for index, plane in enumerate(some.frames):
        x, y, scale = np.linalg.solve(plane, centres.T)
        distance = np.hypot(x, y) / np.abs(scale) * major[index]
        near = distance < _OVERLAP * (outer + outer[index])
        near[index] = False
        on_top[which[index]] &= (some.margin[index] > _ON_TOP * some.margin[near]).all()
    return on_top


def resolve_ids(hypotheses: Hypotheses, ids: np.ndarray, certain: np.ndarray) -> np.ndarray:
    """Return which hypotheses are certain and clearly the best claim to their ID, shape (k,).

    Parameters are as for `resolve_dots`.
    """
    certain = certain.copy()
    for identifier in np.unique(ids[certain]):
        best, *others = np.flatnonzero(certain & (ids == identifier))
        certain[others] = False
        if others and hypotheses.margin[best] <= _CLEARLY * hypotheses.margin[others[0]]:
            certain[best] = False
    return certain
