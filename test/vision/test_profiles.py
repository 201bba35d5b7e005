"""Steps fitted to profiles: exact where the step is exact."""

from math import erf

import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import dot_circles, on_circles
from ahf_ros.vision.edge_fit import edge_points
from ahf_ros.vision.profiles import Edges, measure_outlines

WIDE = 1000.0
"""Radius of a circle that is straight as far as a profile sees, px."""

MIDDLE = (30.0, 20.0)
DARK, BRIGHT = 40.0, 160.0  # as dark and bright as profiles take for usual


def step_image(place: float, blur: float, slope: float = 0.0) -> np.ndarray:
    """Return a blurred vertical step at x = MIDDLE + place, under light with a slope in x."""
    columns = np.arange(61.0) - MIDDLE[0] - place
    rise = 0.5 * (1 + np.array([erf(value / (blur * np.sqrt(2))) for value in columns]))
    row = (DARK + (BRIGHT - DARK) * rise) * (1 + slope * columns)
    return np.tile(row, (41, 1)).astype(np.float32)


def measured(image: np.ndarray, blur: float, polarity: int = 1) -> Edges:
    """Measure the one point of a wide circle that is vertical at MIDDLE."""
    frames = frame.affine_frames([MIDDLE[0] - WIDE], [MIDDLE[1]], [WIDE], [WIDE], [0.0])
    point = on_circles(np.zeros(1), np.ones(1), np.zeros(1, int), np.full((1, 1), polarity))
    outline = edge_points(frames, point)
    return measure_outlines(image, outline, np.array([blur]), reach=2.5 / WIDE)


@pytest.mark.parametrize('blur', [0.6, 0.8, 1.2])
@pytest.mark.parametrize('place', [-0.73, 0.0, 0.2, 0.5])
def test_a_step_is_found_where_it_is(place: float, blur: float) -> None:
    edges = measured(step_image(place, blur), blur)
    # Interpolation between pixels is more blur, which tells in a step far from the middle.
    assert edges.offset[0, 0] == pytest.approx(place, abs=0.015 + 0.04 * abs(place))
    assert edges.dark[0, 0] == pytest.approx(DARK, abs=4)
    assert edges.bright[0, 0] == pytest.approx(BRIGHT, abs=4)
    assert edges.visible[0, 0]


def test_a_step_down_is_found_where_it_is() -> None:
    image = step_image(0.3, 0.8)[:, ::-1]  # now at -0.3, and falling
    edges = measured(np.ascontiguousarray(image), 0.8, polarity=-1)
    assert edges.offset[0, 0] == pytest.approx(-0.3, abs=0.02)
    assert edges.dark[0, 0] < edges.bright[0, 0]


@pytest.mark.parametrize('slope', [-0.04, 0.04])
def test_a_slope_of_the_light_is_seen_and_says_how_far_it_moves_the_step(slope: float) -> None:
    """Without the correction the place is wrong by several times what is left with it."""
    flat = measured(step_image(0.0, 0.9), 0.9)
    edges = measured(step_image(0.0, 0.9, slope), 0.9)
    seen = edges.slope[0, 0] - flat.slope[0, 0]
    assert seen == pytest.approx(slope, rel=0.25)
    moved = edges.offset[0, 0] - flat.offset[0, 0]
    assert abs(moved) > 0.01
    assert abs(moved - edges.sensitivity[0, 0] * seen) < 0.3 * abs(moved)


def test_a_step_of_another_blur_says_so_and_hardly_moves() -> None:
    soft, sharp = (measured(step_image(0.25, blur), 0.9) for blur in (1.3, 0.6))
    assert soft.softness[0, 0] > 0.15
    assert sharp.softness[0, 0] < -0.1
    assert soft.offset[0, 0] == pytest.approx(0.25, abs=0.05)
    assert sharp.offset[0, 0] == pytest.approx(0.25, abs=0.05)


def test_what_is_no_step_leaves_a_residual() -> None:
    line = step_image(0.0, 0.8)
    line[:, int(MIDDLE[0]) + 2 :] = DARK
    assert measured(step_image(0.0, 0.8), 0.8).residual[0, 0] < 2
    assert measured(line, 0.8).residual[0, 0] > 8


def test_the_curve_of_a_small_circle_is_taken_into_account() -> None:
    """Blur moves the edge of a disc inwards; the measured place is that of the edge."""
    radius, blur, scale = 5.0, 0.8, 8
    rows, columns = (np.mgrid[: 41 * scale, : 61 * scale] + 0.5) / scale - 0.5
    inside = np.hypot(columns - 30.3, rows - 20.4) < radius
    spectrum = np.fft.fft2(np.where(inside, DARK, BRIGHT))
    x, y = (np.fft.fftfreq(size, 1 / scale) for size in (61 * scale, 41 * scale))
    pixel = np.sinc(x) * np.sinc(y)[:, None]
    lens = np.exp(-2 * (np.pi * blur) ** 2 * (x**2 + y[:, None] ** 2))
    image = np.fft.ifft2(spectrum * pixel * lens).real
    # Samples at the centres of pixels, between the two finer ones beside them.
    image = sum(image[i::scale, j::scale] for i in (3, 4) for j in (3, 4)) / 4
    frames = frame.affine_frames([30.3], [20.4], [radius], [radius], [0.0])
    outline = edge_points(frames, dot_circles([1], 48))
    edges = measure_outlines(image.astype(np.float32), outline, np.array([0.9]), reach=0.45)
    assert edges.offset.mean() == pytest.approx(0, abs=0.01)
    assert np.abs(edges.offset).max() < 0.05


def test_profiles_beyond_the_image_are_not_visible() -> None:
    frames = frame.affine_frames([2.0], [20.0], [8.0], [8.0], [0.0])
    geometry = edge_points(frames, dot_circles([1], 16))
    edges = measure_outlines(step_image(0, 0.8), geometry, np.array([0.8]), reach=0.45)
    assert not edges.visible[geometry.points[..., 0] < 0].any()
    assert edges.visible[geometry.points[..., 0] > 4].all()
    assert not edges.offset[~edges.visible].any()
