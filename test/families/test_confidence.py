"""The probability of a reading, and the data file of its weights, which tells what made it."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.families.ring.confidence import WEIGHTS, confidence, features
from ahf_ros.families.ring.decoding import DOUBT
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.hypotheses import CERTAIN
from ahf_ros.families.ring.reading import read_bands
from ahf_ros.prints.ring import family
from ahf_ros.vision.logistic import read_weights
from support.ring import measured
from support.scenes import SMALL, rendered, rendering


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


@pytest.mark.parametrize('light', ['normal', 'stripe'])
@pytest.mark.parametrize('radius', [6.0, 18.0])
def test_a_target_shows_what_is_typical_of_its_size_and_light(light: str, radius: float) -> None:
    shown = rendering(
        width=700, height=500, targets=6, dot_radius=radius, light=light, ambient=0.3, seed=5
    )
    found = find_hypotheses(shown.image, DetectorSettings(family='metashape12'))
    found = found.select(found.certain)
    assert len(found.words) >= 6  # a dot may be read twice
    assert 0.7 < np.median(found.seen / found.typical) < 1.4


def test_a_halo_of_sharpening_is_no_arc_of_any_length() -> None:
    shown = rendering(width=1200, height=900, targets=4, dot_radius=34.0, seed=5)
    gray = shown.image.astype(np.float32)
    halo = 2.5 * gray - 1.5 * cv2.GaussianBlur(gray, (0, 0), 1.5)
    found = find_hypotheses(
        np.clip(halo, 0, 255).astype(np.uint8), DetectorSettings(family='metashape12')
    )
    found = found.select(found.certain)
    assert len(found.words) == 4
    assert (found.coded > -DOUBT).all()


def test_each_set_of_weights_says_what_made_it() -> None:
    for purpose, made in json.loads(WEIGHTS.read_text(encoding='utf-8')).items():
        seeds = ' '.join(map(str, made['seeds']))
        assert made['command'] == f'python -m benchmarks.{purpose} --fit {seeds}'
        assert max(made['seeds']) < 101  # those from 101 on are for tests
        assert made['commit']
