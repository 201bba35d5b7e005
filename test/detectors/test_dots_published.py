"""Rings of dots as published: right in even light, defeated by stripes, helped by AHF."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.detectors.dots.published import PublishedDotsDetector, local_otsu, otsu
from ahf_ros.evaluation import score
from ahf_ros.session import identify
from ahf_ros.synthetic.scene import Rendering
from ahf_ros.target import UNDECODED
from support.scenes import counted, rendering

SIZE = {'family': 'dots', 'width': 800, 'height': 600, 'targets': 6, 'dot_radius': 10.0, 'seed': 4}


def scene(**changes: object) -> Rendering:
    return rendering(**SIZE | changes)


def published(**changes: object) -> PublishedDotsDetector:
    return create_detector('dots_published', family='dots', **changes)


@pytest.mark.parametrize(
    'changes',
    [{}, {'dot_radius': 3.8}, {'dot_radius': 14.0}, {'polarity': 'bright'}, {'tilt': 50.0}],
)
def test_all_targets_are_identified_in_even_light(changes: dict) -> None:
    bias = 0.2 if 'tilt' in changes else 0.0  # of the ellipse, under perspective
    shown = scene(**changes)
    found = published()(shown.image)
    assert counted(shown, found) == (6, 0, 0)
    assert score(shown, found).rmse[2] < 0.15 + bias
    codes = {target.id: target.code for target in shown.targets}
    assert all(target.code == codes[target.id] for target in found)


def test_stripes_defeat_it_and_ahf_brings_the_targets_back() -> None:
    shown = scene(light='stripe')
    without = score(shown, published()(shown.image))
    found = identify(shown.image, detector=published(), expected_targets=6)
    assert found.filter.applied
    assert score(shown, found.targets).right >= max(3 * without.right, 4)


def test_a_place_that_is_neither_dot_nor_ground_leaves_a_ring_undecoded() -> None:
    shown = scene(targets=1)
    (target,) = shown.targets
    y, x = np.mgrid[: shown.image.shape[0], : shown.image.shape[1]]
    across, down = (x - target.x) / target.semi_major, (y - target.y) / target.semi_major
    image = shown.image.copy()
    image[(np.hypot(across - 2.3, down) < 0.2)] = image.min()
    assert published()(image) == []
    (found,) = published(report_undecoded=True)(image)
    assert (found.id, found.code, found.confidence) == (UNDECODED, 0, 0.0)


def test_marks_that_are_no_targets_are_not_reported() -> None:
    assert published()(scene(targets=0, distractors=25).image) == []


def test_otsu_parts_two_values_halfway() -> None:
    counts = np.zeros((2, 256), int)
    counts[0, [40, 200]] = 30, 10
    counts[1, 90] = 40
    thresholds, contrast = otsu(counts)
    assert thresholds[0] == pytest.approx(120)
    assert contrast.tolist() == [160, 0]


def test_blocks_without_contrast_take_the_thresholds_about_them() -> None:
    gray = np.full((160, 160), 200, np.uint8)
    gray[60:100, 60:100] = 40
    threshold = local_otsu(gray, 32)
    assert threshold.shape == gray.shape
    assert np.allclose(threshold, 120, atol=1)
    assert np.isfinite(local_otsu(np.full((40, 40), 7, np.uint8), 16)).all()
