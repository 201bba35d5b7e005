"""Where ring targets have edges."""

import numpy as np
import pytest

from ahf_ros.families.ring.circles import target_circles
from ahf_ros.prints.ring import family

CODE = family('metashape12')


@pytest.mark.parametrize('start', [0.0, 0.7, 2 * np.pi - 0.01])
@pytest.mark.parametrize('polarity', [1, -1])
def test_a_marked_sector_has_an_inner_and_an_outer_edge(start: float, polarity: int) -> None:
    """Sectors are counted counter-clockwise as seen, which is towards -y."""
    circles = target_circles(
        np.array([0b000000000100]), np.array([start]), np.array([polarity]), 10, CODE
    )
    for radius, expected in ((CODE.band_inner, -polarity), (CODE.band_outer, polarity)):
        there = (circles.line == radius) & (circles.polarity[0] != 0)
        x, y = circles.points[there].T
        turn = (np.arctan2(-y, x) - start) / (2 * np.pi / 12) % 12
        assert len(turn) == 8  # of ten: next to its ends an arc is rounded off
        assert turn.min() > 2 and turn.max() < 3
        assert turn.mean() == pytest.approx(2.5, abs=0.06)
        assert set(circles.polarity[0, there]) == {expected}


def test_the_number_of_edges_is_that_of_the_marked_sectors() -> None:
    words, polarity = np.array([0b000001000111, 0b111111111110]), np.array([1, 1])
    circles = target_circles(words, np.zeros(2), polarity, 10, CODE)
    marked = (circles.polarity[:, circles.line > 1] != 0).sum(axis=1)
    assert marked.tolist() == [4 * 2 * 8, 11 * 2 * 8]
