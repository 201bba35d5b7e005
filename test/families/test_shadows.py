"""Shadows on black print, which a camera with linear gray values shows hardly above black."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.scenes.evaluation import Score, score
from ahf_ros.scenes.scene import SceneSettings, render

SCENE = SceneSettings(width=1280, height=960, targets=24, dot_radius=8, seed=44)
PEAK, NOISE = 250, 0.7  # gray values
SHADOWS, LONG, WIDE = 40, (40, 160), (20, 60)  # their number and sizes, px
LEFT = 0.08  # share of the light in them
SOFT = 4.0  # deviation of their borders, px


def seen(family: str, polarity: str) -> Score:
    """Return what is read of targets in shadows."""
    scene = replace(SCENE, family=family, polarity=polarity)
    shown, generator = render(scene), np.random.default_rng(scene.seed)
    light = np.ones(shown.image.shape, np.float32)
    for _ in range(SHADOWS):
        middle = generator.uniform(0, light.shape[1]), generator.uniform(0, light.shape[0])
        sides = generator.uniform(*LONG), generator.uniform(*WIDE)
        corners = cv2.boxPoints((middle, sides, generator.uniform(0, 180)))
        cv2.fillConvexPoly(light, np.intp(corners), 0)
    light = LEFT + (1 - LEFT) * cv2.GaussianBlur(light, (0, 0), SOFT)
    gray = PEAK * (shown.image / 255) ** scene.gamma * light
    gray += generator.normal(0, NOISE, gray.shape)
    image = np.clip(np.rint(gray), 0, 255).astype(np.uint8)
    return score(shown, create_detector(family=family)(image))


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('family', ['metashape12', 'aicon14'])
def test_black_print_is_read_in_shadows(family: str, polarity: str) -> None:
    of = seen(family, polarity)
    assert of.right >= of.expected - 1
    assert not of.wrong + of.false_positives


@pytest.mark.parametrize('ambient', [0.3, 0.12])
def test_black_marks_are_read_under_stripes(ambient: float) -> None:
    scene = replace(SCENE, light='stripe', ambient=ambient, gamma=1.0, black=0.04)
    shown = render(scene)
    of = score(shown, create_detector(family=scene.family)(shown.image))
    assert of.right >= of.expected - 2
    assert not of.wrong + of.false_positives
