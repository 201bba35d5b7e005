"""Targets of any size in one image: none is passed over, and centres are those of sharp edges."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.detectors.ring.counting import estimate_count
from ahf_ros.evaluation import score
from support.collage import Collage, collage
from support.square_markers import needs_square_markers

MAXIMUM_ERROR = 0.05
"""Of a centre of any size, px."""


def check(shown: Collage, family: str, **settings: object) -> None:
    """Assert that all targets are identified, with good centres, and nothing else."""
    figures = score(shown.truth, create_detector(family=family, **settings)(shown.image))
    assert (figures.right, figures.wrong, figures.false_positives) == (len(shown.truth), 0, 0)
    assert np.abs(figures.errors).max() < MAXIMUM_ERROR


def test_dots_of_4_to_300_px_in_one_image():
    check(collage([300.0, 150.0, 65.0, 20.0, 8.0, 4.0]), 'metashape12')


@pytest.mark.parametrize(('light', 'polarity'), [('stripe', 'bright'), ('lattice', 'dark')])
def test_large_dots_in_projected_light_that_are_seen_from_the_side(light, polarity):
    shown = collage(
        [150.0, 65.0, 20.0], light=light, ambient=0.12, tilt=40.0, polarity=polarity, seed=3
    )
    check(shown, 'metashape12')
    assert estimate_count(shown.image) == len(shown.truth)


def test_families_compete_for_large_dots():
    shown = collage([150.0, 100.0], 'aicon14', seed=5)
    check(shown, 'auto')


@pytest.mark.parametrize(
    ('family', 'radii'),
    [
        ('dots', [200.0, 100.0, 20.0, 8.0]),
        ('gsi', [70.0, 20.0, 5.0]),
        pytest.param('aruco_4x4_50', [150.0, 20.0, 6.0], marks=needs_square_markers),
    ],
)
def test_large_dots_of_other_families(family, radii):
    check(collage(radii, family), family)


def test_limits_are_obeyed_at_every_size():
    shown = collage([150.0, 65.0, 20.0])
    ids = [target.id for target in shown.truth]
    for limits, expected in (
        ({'max_radius': 100.0}, ids[1:]),
        ({'min_radius': 100.0}, ids[:1]),
        ({'min_radius': 40.0, 'max_radius': 100.0}, ids[1:2]),
        ({'min_radius': 2000.0}, []),
    ):
        found = create_detector(**limits)(shown.image)
        assert sorted(target.id for target in found) == sorted(expected)
