"""Counts of targets from images, whether their words can be read or not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.detectors.ring.counting import estimate_count
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render

SMALL = {'width': 900, 'height': 640, 'targets': 6}


def scene(**changes) -> Rendering:
    return render(SceneSettings(**{**SMALL, **changes}))


@pytest.mark.parametrize(
    ('light', 'ambient'),
    [('normal', 0.3), ('stripe', 0.3), ('stripe', 0.04), ('lattice', 0.12), ('spots', 0.04)],
)
def test_the_count_is_right_under_any_light(light, ambient):
    assert estimate_count(scene(light=light, ambient=ambient, seed=11).image) == 6


@pytest.mark.parametrize(
    'changes',
    [
        {'polarity': 'bright'},
        {'family': 'aicon14'},
        {'family': 'metashape20', 'light': 'stripe'},
        {'dot_radius': 8.0},
        {'tilt': 45.0, 'focal_length': 3.0},
    ],
)
def test_the_count_is_right_for_targets_of_any_kind(changes):
    rendering = scene(**changes, seed=12)
    wanted = DetectorSettings(family=rendering.settings.family)
    assert estimate_count(rendering.image, wanted) == 6


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
def test_none_is_counted_where_there_is_none(light):
    clutter = scene(targets=0, distractors=10, light=light, seed=13)
    assert estimate_count(clutter.image) == 0


def test_noise_is_no_target():
    generator = np.random.default_rng(1)
    assert estimate_count(generator.integers(0, 256, (300, 400), np.uint8)) == 0


def test_a_ramp_shows_no_dots_at_all():
    ramp = np.arange(200, dtype=np.uint8) + np.zeros((150, 1), np.uint8)
    assert estimate_count(ramp) == 0


def test_targets_count_whose_bands_are_half_hidden():
    rendering = scene(seed=14)
    image = rendering.image.copy()
    for target in rendering.targets:
        reach = 1.1 * target.semi_major * family('metashape12').band_outer
        corner = np.rint([target.x + 1.4 * target.semi_major, target.y - reach]).astype(int)
        opposite = np.rint([target.x + reach, target.y + reach]).astype(int)
        cv2.rectangle(image, tuple(corner.tolist()), tuple(opposite.tolist()), 110, -1)
    assert len(create_detector('ring')(image)) < 6
    assert estimate_count(image) == 6


def test_radii_and_polarity_bound_what_counts():
    image = scene(seed=15).image
    assert estimate_count(image, DetectorSettings(polarity='bright')) == 0
    assert estimate_count(image, DetectorSettings(max_radius=12.0)) == 0


@pytest.mark.parametrize('kind', [np.uint16, np.float32])
def test_images_of_more_bits_are_counted(kind):
    assert estimate_count(scene(seed=16).image.astype(kind) * 4) == 6


def test_the_same_image_gives_the_same_count():
    image = scene(light='dense_lattice', ambient=0.04, seed=17).image
    assert estimate_count(image) == estimate_count(image.copy())


@pytest.mark.parametrize(
    ('image', 'words'),
    [
        (np.zeros((20, 30, 3), np.uint8), 'image'),
        (np.full((20, 30), np.nan), 'image has NaN'),
        (np.full((20, 30), 7, np.uint8), 'image is constant'),
    ],
)
def test_what_is_no_image_is_refused(image, words):
    with pytest.raises(ValueError, match=words):
        estimate_count(image)


@pytest.mark.parametrize(('paper', 'ink'), [(200, 20), (20, 200)])
def test_dots_without_a_band_are_no_targets(paper, ink):
    image = np.full((400, 600), paper, np.uint8)
    for x, radius in zip(range(80, 600, 110), (6, 9, 12, 16, 20), strict=True):
        cv2.circle(image, (x, 200), radius, ink, -1, cv2.LINE_AA)
    assert estimate_count(cv2.GaussianBlur(image, (0, 0), 0.8)) == 0
