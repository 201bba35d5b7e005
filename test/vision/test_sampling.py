"""Gray values at points and on circles."""

import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.sampling import sample, sample_circles, within

OBLIQUE = np.array([[[20.0, 3.0, 100.5], [-2.0, 12.0, 80.25], [0.02, -0.01, 1.0]]])
ANGLES = np.linspace(0, 2 * np.pi, 24, endpoint=False)


def test_samples_of_a_slope_are_those_of_the_slope() -> None:
    rows, columns = np.mgrid[:20, :30]
    image = (2 * columns + 3 * rows).astype(np.float32)
    pixels = np.array([[3.25, 4.5], [10.0, 11.75]])
    assert sample(image, pixels) == pytest.approx([20.0, 55.25])


def test_the_border_goes_on_beyond_the_image() -> None:
    image = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert sample(image, np.array([[-5.0, 0.0], [9.0, 2.0]])).tolist() == [0.0, 11.0]


def test_circles_are_sampled_where_they_are_projected() -> None:
    rows, columns = np.mgrid[:160, :200]
    image = (columns + 0.5 * rows).astype(np.float32)
    radii = np.array([0.5, 1.0, 2.0])
    sampled = sample_circles(image, OBLIQUE, ANGLES, radii)
    projected = sample(image, frame.project(OBLIQUE, frame.circle_points(ANGLES, radii)))
    assert sampled == pytest.approx(projected, abs=0.02)


def test_what_lies_in_an_image() -> None:
    pixels = np.array([[0.0, 0.0], [29.0, 19.0], [29.1, 5.0], [5.0, -0.1]])
    assert within(pixels, (20, 30)).tolist() == [True, True, False, False]
