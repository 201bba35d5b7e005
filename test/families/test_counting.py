"""Counts of targets from images, whether their words can be read or not."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.families.ring.counting import estimate_count
from ahf_ros.prints.ring import family
from ahf_ros.scenes.scene import Rendering, SceneSettings
from support.scenes import identified, rendered

SMALL = SceneSettings(width=800, height=560, targets=6, seed=12)
RINGS = DetectorSettings(family=SMALL.family)


def scene(**changes: Any) -> Rendering:
    return rendered(replace(SMALL, **changes))


@pytest.mark.parametrize(
    'changes',
    [
        *(
            {'light': light, 'ambient': ambient, 'seed': 11}
            for light, ambient in (
                ('normal', 0.3),
                ('stripe', 0.3),
                ('stripe', 0.04),
                ('lattice', 0.12),
                ('spots', 0.04),
            )
        ),
        {'polarity': 'bright'},
        {'family': 'aicon14'},
        {'family': 'metashape20', 'light': 'stripe'},
        {'dot_radius': 8.0},
        {'tilt': 45.0, 'focal_length': 3.0},
    ],
)
def test_the_count_is_right_under_any_light_and_for_targets_of_any_kind(changes: Any) -> None:
    shown = scene(**changes)
    assert estimate_count(shown.image, DetectorSettings(family=shown.settings.family)) == 6


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
def test_none_is_counted_where_there_is_none(light: str) -> None:
    assert estimate_count(scene(targets=0, distractors=10, light=light, seed=13).image, RINGS) == 0


NOISE = np.random.default_rng(1).integers(0, 256, (300, 400), np.uint8)
RAMP = np.arange(200, dtype=np.uint8) + np.zeros((150, 1), np.uint8)


@pytest.mark.parametrize('image', [NOISE, RAMP], ids=['noise', 'a ramp without any dots'])
def test_what_shows_no_target_has_none(image: np.ndarray) -> None:
    assert estimate_count(image, RINGS) == 0


def test_targets_count_whose_bands_are_half_hidden() -> None:
    shown = scene()
    image = shown.image.copy()
    for target in shown.targets:
        reach = 1.1 * target.semi_major * family('metashape12').band_outer
        corner = np.rint([target.x + 1.4 * target.semi_major, target.y - reach]).astype(int)
        opposite = np.rint([target.x + reach, target.y + reach]).astype(int)
        cv2.rectangle(image, tuple(corner.tolist()), tuple(opposite.tolist()), 110, -1)
    assert len(identified(image)) < 6
    assert estimate_count(image, RINGS) == 6


def test_radii_and_polarity_bound_what_counts() -> None:
    image = scene().image
    assert estimate_count(image, replace(RINGS, polarity='bright')) == 0
    assert estimate_count(image, replace(RINGS, max_radius=12.0)) == 0


@pytest.mark.parametrize('kind', [np.uint16, np.float32])
def test_images_of_more_bits_are_counted(kind: Any) -> None:
    assert estimate_count(scene().image.astype(kind) * 4, RINGS) == 6


@pytest.mark.parametrize(('paper', 'ink'), [(200, 20), (20, 200)])
def test_dots_without_a_band_are_no_targets(paper: int, ink: int) -> None:
    image = np.full((400, 600), paper, np.uint8)
    for x, radius in zip(range(80, 600, 110), (6, 9, 12, 16, 20), strict=True):
        cv2.circle(image, (x, 200), radius, ink, -1, cv2.LINE_AA)
    assert estimate_count(cv2.GaussianBlur(image, (0, 0), 0.8), RINGS) == 0
