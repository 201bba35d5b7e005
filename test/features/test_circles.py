"""Where edges of targets are expected."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.features.circles import dot_circles, ring_circles

CODE = family('metashape12')


def test_a_dark_dot_is_brighter_outside():
    circles = dot_circles(np.array([1, -1]), 8)
    assert circles.polarity.tolist() == [[1] * 8, [-1] * 8]
    assert circles.radii.tolist() == [1.0] * 8
    assert circles.spacing == pytest.approx(np.full(8, np.pi / 4))


@pytest.mark.parametrize('start', [0.0, 0.7, 2 * np.pi - 0.01])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_marked_sector_has_an_inner_and_an_outer_edge(start, sign):
    """Sectors are counted counter-clockwise as seen, which is towards -y."""
    circles = ring_circles(
        np.array([0b000000000100]), np.array([start]), np.array([sign]), 16, 10, CODE
    )
    for radius, expected in ((CODE.band_inner, -sign), (CODE.band_outer, sign)):
        there = (circles.radii == radius) & (circles.polarity[0] != 0)
        turn = (-circles.angles[there] - start) / (2 * np.pi / 12) % 12
        assert len(turn) == 8  # of ten: next to its ends an arc is rounded off
        assert turn.min() > 2 and turn.max() < 3
        assert turn.mean() == pytest.approx(2.5, abs=0.06)
        assert set(circles.polarity[0, there]) == {expected}


def test_the_number_of_edges_is_that_of_the_marked_sectors():
    words, signs = np.array([0b000001000111, 0b111111111110]), np.array([1, 1])
    circles = ring_circles(words, np.zeros(2), signs, 16, 10, CODE)
    marked = (circles.polarity[:, circles.radii > 1] != 0).sum(axis=1)
    assert marked.tolist() == [4 * 2 * 8, 11 * 2 * 8]


def test_spacing_is_the_distance_to_the_next_point_of_a_circle():
    circles = ring_circles(np.array([71]), np.zeros(1), np.ones(1, int), 16, 10, CODE)
    assert circles.spacing[0] == pytest.approx(2 * np.pi / 16)
    assert circles.spacing[-1] == pytest.approx(2 * np.pi * CODE.band_outer / 120)
