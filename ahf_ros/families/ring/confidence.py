"""The probability that a reading is right.

There has to be a target, no pattern of light and no other mark, and its word has to be right,
whatever covers a part of it. Each has a log odds, which would be the probability if all readings
were independent and all scenes alike. A logistic regression on rendered scenes, on targets that
are covered, glossy, over-exposed or of other families and on clutter, says how far they can be
trusted. None of its weights is negative: what speaks for a reading speaks for it everywhere. Its
probability is multiplied by that of the margin over the next ID. `benchmarks.confidence` fits it
and shows how far it can be trusted.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.prints.ring import borders, marks
from ahf_ros.vision.logistic import logistic, read_weights

COVERED = 0.25
"""Share of sectors that covers hide at the most where they leave even ground beyond a band."""

WEIGHTS = Path(__file__).with_name('fitted_weights.json')
"""The data file, which says what made it."""

_OF_TARGET = np.concatenate(read_weights(WEIGHTS, 'confidence', 'intercept', 'weights'))
_LITTLE = 3.0  # log odds of a typical target, of which no share is asked for
_BARE = 30.0  # log odds of words against bare paper that leave a doubt
_MANY = 0.4  # share of marks from which words have these odds, and fewer below it
_OF_MARGIN = np.array([-1.0, 1.0])  # one or two log odds leave a doubt


def features(read: Hypotheses) -> np.ndarray:
    """Return what speaks for readings, float64, shape (k, 8).

    Logarithm of the log odds of words against the next ID; root of the log odds of arcs of ink of
    any length against them, negative; the shares that are missing of the expected edges, and of
    the evidence of a typical target of this size in this light, negative; how easily bare paper
    shows the word, negative; how easily spots of light show it, where light is uneven, negative;
    the share of sectors that look like another print, beyond what covers explain, negative; the
    evidence of the outer edges of marks, as a share of that typical evidence, where it speaks
    against them: spots of a lattice about a spot show a word, but reach beyond its band.
    """
    uneven = np.isnan(read.unlike)
    typical = np.maximum(read.typical, _LITTLE)
    return np.stack(
        [
            np.log1p(np.maximum(read.margin, 0)),
            1 - np.sqrt(1 + np.maximum(-read.coded, 0)),
            read.share - 1,
            np.clip(read.seen / typical, 0, 1) - 1,
            -np.exp(-np.maximum(read.marked, 0) / _of_bare_paper(read)),
            -np.exp(1 - _spots(read)) * uneven,
            np.where(uneven, 0, np.minimum(COVERED - read.unlike, 0)),
            np.clip(read.outer / typical, -1, 0),
        ],
        axis=1,
    )


def _of_bare_paper(read: Hypotheses) -> np.ndarray:
    """Return log odds against bare paper that leave a doubt, shape (k,), by words' marks."""
    odds = np.full(len(read.words), _BARE)
    for code in dict.fromkeys(read.families):
        which = read.families == code
        share = np.maximum(marks(read.words[which], code.bits), 1) / code.bits
        odds[which] *= np.minimum(share / _MANY, 1)
    return odds


def _spots(read: Hypotheses) -> np.ndarray:
    """Return how many spots of light as large as the dot it takes to show words, shape (k,)."""
    spots = np.zeros(len(read.words))
    for code in dict.fromkeys(read.families):
        which = read.families == code
        words = read.words[which]
        length = marks(words, code.bits) / code.bits * np.pi * sum(code.band)  # dot radii
        spots[which] = np.maximum(length / 2, borders(words, code.bits) / 2)
    return spots


def rated(read: Hypotheses) -> Hypotheses:
    """Return hypotheses with their confidence, which is 0 where there is no word."""
    return replace(read, confidence=np.where(read.words > 0, confidence(features(read)), 0.0))


def confidence(values: np.ndarray) -> np.ndarray:
    """Return the probabilities that readings are right, shape (k,), from their `features`."""
    return target_probability(values) * logistic(np.expm1(values[:, :1]), _OF_MARGIN)


def target_probability(values: np.ndarray) -> np.ndarray:
    """Return the probabilities that readings are of targets, shape (k,), values (k, 8)."""
    return logistic(values, _OF_TARGET)
