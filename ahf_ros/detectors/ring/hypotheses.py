"""Hypotheses on the dots of an image, and how contradicting ones are settled."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ahf_ros.codes.ring import Family
from ahf_ros.detectors.ring import decoding
from ahf_ros.features import circle_fit, frame

CERTAIN = 0.98
"""Confidence from which a word is reported."""

_CLEARLY = 2.0  # times the evidence of another claim to the same ID or dot


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """k dots, and what their bands were read as.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that are in their place.
    words : ndarray of int64, shape (k,)
        In the rotation read; 0 where no word is plausible.
    margin : ndarray of float64, shape (k,)
        Evidence over the best word of another ID, in units of ln.
    features : ndarray of float64, shape (k, n)
        What the confidence is computed from, see `decoding.confidence_features`.
    confidence : ndarray of float64, shape (k,)
        Probability that the word is right.
    """

    frames: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    words: np.ndarray
    margin: np.ndarray
    features: np.ndarray
    confidence: np.ndarray

    @staticmethod
    def unread(fit: circle_fit.Fit) -> Hypotheses:
        """Return dots of which no band was read."""
        count = len(fit.frames)
        return Hypotheses(
            fit.frames.copy(),
            fit.covariance.copy(),
            fit.share.copy(),
            words=np.zeros(count, np.int64),
            margin=np.zeros(count),
            features=np.zeros((count, decoding.FEATURES)),
            confidence=np.zeros(count),
        )

    def update(self, which: np.ndarray, readings: decoding.Readings, fit: circle_fit.Fit) -> None:
        """Take over the readings of some of the dots."""
        features = decoding.confidence_features(readings, fit)
        self.frames[which], self.covariance[which] = fit.frames, fit.covariance
        self.share[which] = fit.share
        self.words[which], self.margin[which] = readings.words, readings.margin
        self.features[which] = features
        self.confidence[which] = decoding.confidence(features)

    def chosen(self, which: np.ndarray) -> Hypotheses:
        """Return some of the dots."""
        return Hypotheses(*(getattr(self, item.name)[which] for item in fields(self)))

    @staticmethod
    def joined(parts: list[Hypotheses]) -> Hypotheses:
        """Return the dots of several finds."""
        names = [item.name for item in fields(Hypotheses)]
        return Hypotheses(*(np.concatenate([getattr(of, n) for of in parts]) for n in names))


def settled_dots(
    found: Hypotheses, numbers: np.ndarray, certain: np.ndarray, code: Family
) -> tuple[np.ndarray, np.ndarray]:
    """Return the best hypotheses of each dot, and where no other reading comes near to it.

    Hypotheses come in the order of their evidence. Dots on a band that has been read are its
    sectors, and not kept.
    """
    major, minor, _ = frame.ellipse_axes(found.frames)
    reach = np.where(certain, code.band_outer * minor, major)
    uncontested = np.ones(len(numbers), bool)
    kept: list[int] = []
    for index, centre in enumerate(found.frames[:, :2, 2]):
        distance = np.hypot(*(found.frames[kept, :2, 2] - centre).T)
        same = [other for other, near in zip(kept, distance < reach[kept], strict=True) if near]
        if not same:
            kept.append(index)
        for other in same:
            if certain[index] and numbers[index] != numbers[other]:
                uncontested[other] &= found.margin[other] > _CLEARLY * found.margin[index]
    dropped = np.ones(len(numbers), bool)
    dropped[kept] = False
    return np.array(kept, np.intp), uncontested & ~dropped


def settled_numbers(found: Hypotheses, numbers: np.ndarray, certain: np.ndarray) -> np.ndarray:
    """Return which readings are certain and clearly the best claim to their ID."""
    certain = certain.copy()
    for number in np.unique(numbers[certain]):
        best, *others = np.flatnonzero(certain & (numbers == number))
        certain[others] = False
        if others and found.margin[best] <= _CLEARLY * found.margin[others[0]]:
            certain[best] = False
    return certain
