"""Octaves: every radius is in one, and no dot has more pixels than it needs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from ahf_ros.features.pyramid import image_pyramid, octaves

IMAGE = np.random.default_rng(0).integers(0, 256, (300, 1700)).astype(np.uint8)


def bounds(low: float, high: float) -> list[tuple[float, float]]:
    """Return the radii of the octaves, px of the image."""
    pyramid = image_pyramid(IMAGE, high)
    return [
        (it.radii[0] * 2**it.level, it.radii[1] * 2**it.level)
        for it in octaves(pyramid, low, high)
    ]


def test_every_radius_up_to_half_of_the_image_is_in_an_octave():
    every = bounds(4.0, 1e4)
    assert every[0][0] == 4
    assert every[-1][1] >= IMAGE.shape[1] / 2
    for (_, end), (start, _) in pairwise(every):
        assert 0.9 * end < start < end


def test_no_dot_of_an_octave_is_larger_than_those_of_the_first():
    for octave in octaves(image_pyramid(IMAGE, 1e4), 4.0, 1e4):
        height, width = (side // 2**octave.level for side in IMAGE.shape)
        assert octave.pyramid.gray.shape == octave.pyramid.logs[0].shape == (height, width)
        assert octave.radii[1] < 93
        mean = octave.pyramid.gray.mean()
        assert mean == pytest.approx(IMAGE.mean(), abs=1.0)


@pytest.mark.parametrize(
    ('low', 'high', 'count'), [(4.0, 60.0, 1), (4.0, 100.0, 2), (150.0, 160.0, 1), (9.0, 8.0, 0)]
)
def test_bounds_are_obeyed(low, high, count):
    every = bounds(low, high)
    assert len(every) == count
    assert all(low <= start <= end <= high for start, end in every)
