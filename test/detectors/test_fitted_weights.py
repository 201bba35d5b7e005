"""The data file of fitted weights: complete, and open about what made it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ahf_ros.detectors.ring.confidence import FEATURES, terms
from ahf_ros.detectors.ring.fitted_weights import PATH, fitted_weights


def test_the_count_has_a_weight_for_every_feature_each_product_and_an_intercept():
    means, deviations, weights = fitted_weights('counting', 'means', 'deviations', 'weights')
    count = len(means) + 1
    assert (len(deviations), len(weights)) == (len(means), count * (count + 1) // 2)
    assert deviations.min() > 0


def test_the_confidence_only_rises_with_what_speaks_for_a_reading():
    intercepts, *both = fitted_weights('confidence', 'intercepts', 'even', 'edges')
    assert intercepts.shape == (2,)
    for weights in both:
        assert terms(np.zeros((1, FEATURES))).shape == (1, len(weights))
        assert weights.min() >= 0


@pytest.mark.parametrize('purpose', ['confidence', 'counting'])
def test_each_set_says_what_made_it(purpose):
    made = json.loads(PATH.read_text(encoding='utf-8'))[purpose]
    seeds = ' '.join(map(str, made['seeds']))
    assert made['command'] == f'python -m benchmarks.{purpose} --fit {seeds}'
    assert max(made['seeds']) < 101  # those from 101 on are for tests
    assert made['commit']
