"""What tells squares seen by a camera from letters and the like."""

import numpy as np
import pytest

from ahf_ros.families.square.frames import SQUARE, square_frames
from ahf_ros.families.square.shapes import parallel_odds


def trapezoid(side: float, upper: float) -> np.ndarray:
    """Return corners about (0, 0), the upper side shorter by a factor."""
    return side * SQUARE * [[upper, 1], [upper, 1], [1, 1], [1, 1]]


@pytest.mark.parametrize(
    ('side', 'upper', 'lowest', 'highest'),
    [
        (30.0, 1.0, -1e-6, 0.0),
        (30.0, 0.98, -0.1, 0.0),  # what the corners of contours are off
        (30.0, 0.5, -6.0, -6.0),
        (600.0, 0.7, -0.5, 0.0),  # so near that its sides may converge
    ],
)
def test_small_squares_have_parallel_sides(
    side: float, upper: float, lowest: float, highest: float
) -> None:
    (odds,) = parallel_odds(square_frames(trapezoid(side, upper)[None]), 1000)
    assert lowest <= odds <= highest


def test_a_sheared_square_is_one_that_is_tilted() -> None:
    sheared = 30 * SQUARE @ np.array([[1, 0.2], [0.3, 0.6]])
    assert parallel_odds(square_frames(sheared[None]), 1000) == pytest.approx(0, abs=1e-6)
