"""The data file of fitted weights: complete, and open about what made it."""

from __future__ import annotations

import json

import numpy as np

from ahf_ros.detectors.ring.confidence import confidence
from ahf_ros.detectors.ring.fitted_weights import PATH, fitted_weights


def test_the_confidence_only_rises_with_what_speaks_for_a_reading() -> None:
    intercept, weights = fitted_weights('confidence', 'intercept', 'weights')
    assert (intercept.shape, weights.shape) == ((1,), (5,))
    assert weights.min() >= 0
    usual = np.array([[3.0, 5.0, 5.0, 2.0, 0.9]])
    for column in range(5):
        more = usual + 0.3 * (np.arange(5) == column)
        assert confidence(more)[0] >= confidence(usual)[0]


def test_each_set_says_what_made_it() -> None:
    for purpose, made in json.loads(PATH.read_text(encoding='utf-8')).items():
        seeds = ' '.join(map(str, made['seeds']))
        assert made['command'] == f'python -m benchmarks.{purpose} --fit {seeds}'
        assert max(made['seeds']) < 101  # those from 101 on are for tests
        assert made['commit']
