"""The kernel of rings of CCTags, against loops in plain Python and differences."""

import math

import numpy as np
import pytest

from ahf_ros import kernels

ALONG = np.linspace(0.06, 1.3, 40)
CIRCLES = [1.0, -0.83, 0.7, -0.42]
MASK = 1.5


def plainly(place: float, size: float, shift: float, blur: float, sharpening: float) -> float:
    """Return the ink of circles at a place along the radius."""
    ink = 0.0
    for width, share in ((blur, 1 + sharpening), (math.hypot(blur, MASK), -sharpening)):
        at = math.hypot(place, width / size) * size
        for circle in CIRCLES:
            sign = math.copysign(1.0, circle)
            away = (abs(circle) * size + sign * shift - at) / width
            ink += share * sign * (1 + math.erf(away / math.sqrt(2))) / 2
    return ink


def rings(edges: np.ndarray) -> tuple[np.ndarray, ...]:
    circles = np.tile(CIRCLES, (len(edges), 1))
    return kernels.cctag_rings(circles, *edges.T, ALONG, MASK)[:5]


def test_rings_are_those_of_plain_loops() -> None:
    generator = np.random.default_rng(1)
    edges = generator.uniform([15, -0.5, 0.4, 0], [30, 0.5, 1.5, 3], (20, 4))
    expected = [[plainly(place, *edge) for place in ALONG] for edge in edges.tolist()]
    ink, _, *changes = rings(edges)
    np.testing.assert_allclose(ink, expected, atol=1e-5)
    for index, change in enumerate(changes, 1):
        step = np.zeros(4)
        step[index] = 0.01
        scale = edges[:, 2:3] if index == 2 else 1.0  # it is by ln of the blur
        difference = (rings(edges + step)[0] - rings(edges - step)[0]) / 0.02 * scale
        # What blur moves outwards changes with it, which hardly matters.
        inner, most = (15, 0.08) if index == 2 else (0, 0.01)
        np.testing.assert_allclose(change[:, inner:], difference[:, inner:], atol=most)


@pytest.mark.parametrize('bad', [0.0, math.nan, math.inf, -1e300])
def test_bad_values_end(bad: float) -> None:
    rings(np.full((1, 4), bad))
    kernels.cctag_rings([[bad]], [bad], [0.0], [1.0], [-1.0], [0.5], MASK)
