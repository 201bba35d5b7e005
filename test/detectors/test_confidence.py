"""The probability of a reading, and the data file of its weights, which tells what made it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.confidence import WEIGHTS, confidence, features
from ahf_ros.detectors.ring.hypotheses import CERTAIN
from ahf_ros.detectors.ring.reading import read_bands
from ahf_ros.features.logistic import read_weights
from support.ring import measured
from support.scenes import SMALL, rendered


def test_confidence_is_a_probability_that_grows_with_the_evidence() -> None:
    scene = rendered(SMALL)
    x, y, radii = np.array([(of.x, of.y, of.semi_major) for of in scene.targets]).T
    gray = scene.image.astype(np.float32)
    found = read_bands(gray, measured(gray, x, y, radii), family(SMALL.family))
    sure = confidence(features(found))
    intercept, weights = read_weights(WEIGHTS, 'confidence', 'intercept', 'weights')
    assert features(found).shape == (6, len(weights))
    assert len(intercept) == 1
    assert weights.min() >= 0  # so that more evidence never makes it less sure
    assert ((sure > 0.9) & (sure <= 1)).all()
    assert np.array_equal(sure, found.confidence)
    for name in ('margin', 'marked', 'seen', 'coded', 'share'):
        values = getattr(found, name)
        less = confidence(features(replace(found, **{name: values - np.abs(values) / 2})))
        assert ((less >= 0) & (less <= sure)).all(), name
    against = replace(found, marked=-found.marked, coded=found.coded - 50)
    assert (confidence(features(against)) < CERTAIN).all()
    assert confidence(features(replace(found, margin=0 * found.margin))).max() <= 0.5


def test_each_set_of_weights_says_what_made_it() -> None:
    for purpose, made in json.loads(WEIGHTS.read_text(encoding='utf-8')).items():
        seeds = ' '.join(map(str, made['seeds']))
        assert made['command'] == f'python -m benchmarks.{purpose} --fit {seeds}'
        assert max(made['seeds']) < 101  # those from 101 on are for tests
        assert made['commit']
