"""The data file of fitted weights: complete, and open about what made it."""

from __future__ import annotations

import json

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.confidence import WEIGHTS, confidence, features
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features.circle_fit import NO_FITS
from ahf_ros.features.logistic import read_weights


def test_the_confidence_only_rises_with_what_speaks_for_a_reading() -> None:
    nothing_read = Hypotheses.unread(NO_FITS, family('metashape12'))
    intercept, weights = read_weights(WEIGHTS, 'confidence', 'intercept', 'weights')
    assert (len(intercept), len(weights)) == (1, len(features(nothing_read).T))
    assert weights.min() >= 0
    usual = np.full((1, len(weights)), 2.0)
    for more in usual + 0.3 * np.eye(len(weights)):
        assert confidence(more[None])[0] >= confidence(usual)[0]


def test_each_set_says_what_made_it() -> None:
    for purpose, made in json.loads(WEIGHTS.read_text(encoding='utf-8')).items():
        seeds = ' '.join(map(str, made['seeds']))
        assert made['command'] == f'python -m benchmarks.{purpose} --fit {seeds}'
        assert max(made['seeds']) < 101  # those from 101 on are for tests
        assert made['commit']
