"""Where edges of circles are expected."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.features.circles import Circles, dot_circles


def test_a_dark_dot_is_brighter_outside():
    circles = dot_circles(np.array([1, -1]), 8)
    assert circles.polarity.tolist() == [[1] * 8, [-1] * 8]
    assert circles.radii.tolist() == [1.0] * 8
    assert circles.group.tolist() == [0] * 8
    assert circles.spacing == pytest.approx(np.full(8, np.pi / 4))


def test_spacing_is_the_distance_to_the_next_point_of_a_circle():
    radii = np.repeat([1.0, 3.0], [16, 120])
    circles = Circles(np.zeros(136), radii, (radii > 1).astype(int), np.ones((1, 136), int))
    assert circles.spacing[0] == pytest.approx(2 * np.pi / 16)
    assert circles.spacing[-1] == pytest.approx(2 * np.pi * 3 / 120)
