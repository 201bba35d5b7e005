"""Rings of dots as published: the threshold, and what is no code."""

import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED
from ahf_ros.families import create_detector
from ahf_ros.families.published.dots import local_otsu, otsu
from support.scenes import rendering


def test_a_place_that_is_neither_dot_nor_ground_leaves_a_ring_undecoded() -> None:
    shown = rendering(family='dots', width=800, height=600, targets=1, dot_radius=10.0, seed=4)
    (target,) = shown.targets
    y, x = np.mgrid[: shown.image.shape[0], : shown.image.shape[1]]
    across, down = (x - target.x) / target.semi_major, (y - target.y) / target.semi_major
    image = shown.image.copy()
    image[(np.hypot(across - 2.3, down) < 0.2)] = image.min()
    plain, all_rings = (
        create_detector('dots_published', family='dots', report_undecoded=undecoded)
        for undecoded in (False, True)
    )
    assert plain(image) == []
    (found,) = all_rings(image)
    assert (found.id, found.code, found.confidence) == (UNDECODED, 0, 0.0)


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
