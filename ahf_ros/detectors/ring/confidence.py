"""The probability that a reading is right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ahf_ros.detectors.ring.hypotheses import Hypotheses

CERTAIN = 0.9
"""Confidence from which words are reported."""


def confidence(read: Hypotheses) -> np.ndarray:
    """Return the probabilities that readings are right, shape (k,)."""
    features = np.stack(
        [
            np.log1p(np.maximum(read.margin, 0)),
            np.log1p(np.maximum(read.seen, 0)),
            read.share,
            np.log(read.deviation + 0.001),
        ]
    )
    evidence = np.array([1.3, 2.0, 22.0, -1.0]) @ features - 33.0
    return 1 / (1 + np.exp(-np.clip(evidence, -30, 30)))
