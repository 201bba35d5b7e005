"""Pyramids: their halves, logarithms and edges, and the octaves of radii in them."""

from itertools import pairwise

import numpy as np
import pytest

from ahf_ros.vision import log_edges
from ahf_ros.vision.log_edges import LOG_SCALE, LogEdges, edges_in_bands, find_edges
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.pyramid import MINIMUM_ASPECT, halved, image_pyramid, log_image, octaves

IMAGE = np.random.default_rng(0).integers(0, 256, (300, 1700)).astype(np.uint8)


def bounds(low: float, high: float, image: np.ndarray = IMAGE) -> list[tuple[float, float]]:
    """Return the radii of the octaves, px of the image."""
    pyramid = image_pyramid(image, high)
    return [
        (it.radii[0] * 2**it.level, it.radii[1] * 2**it.level)
        for it in octaves(pyramid, low, high)
    ]


@pytest.mark.parametrize('shape', [(300, 1700), (900, 1700), (1700, 900), (17, 1700)])
def test_every_radius_of_a_dot_that_fits_into_the_image_is_in_an_octave(
    shape: tuple[int, int],
) -> None:
    image = np.resize(IMAGE, shape)
    every = bounds(4.0, 1e4, image)
    assert every[0][0] == 4
    largest = min(max(shape), min(shape) / MINIMUM_ASPECT) / 2
    assert largest <= every[-1][1] < max(4 * largest, 93)
    for (_, end), (start, _) in pairwise(every):
        assert 0.9 * end < start < end


def test_no_dot_of_an_octave_is_larger_than_those_of_the_first() -> None:
    for octave in octaves(image_pyramid(IMAGE, 1e4), 4.0, 1e4):
        height, width = (side // 2**octave.level for side in IMAGE.shape)
        assert octave.pyramid.gray.shape == octave.pyramid.logs[0].shape == (height, width)
        assert octave.radii[1] < 93
        mean = octave.pyramid.gray.mean()
        assert mean == pytest.approx(IMAGE.mean(), abs=1.0)


@pytest.mark.parametrize(
    ('low', 'high', 'count'), [(4.0, 60.0, 1), (4.0, 100.0, 2), (150.0, 160.0, 1), (9.0, 8.0, 0)]
)
def test_bounds_are_obeyed(low: float, high: float, count: int) -> None:
    every = bounds(low, high)
    assert len(every) == count
    assert all(low <= start <= end <= high for start, end in every)


def test_the_logarithm_of_bytes_and_of_numbers_is_the_same() -> None:
    gray = np.arange(256, dtype=np.uint8).reshape(16, 16)
    log = log_image(gray)
    assert log.dtype == np.int16
    assert log[0, 0] == int(LOG_SCALE * np.log(LOG_OFFSET))
    assert np.abs(log_image(gray.astype(np.float32)) - log).max() <= 1


def test_a_step_is_as_high_in_the_shadow_as_in_the_light() -> None:
    dark, bright = np.float32([[20, 60]]), np.float32([[100, 220]])
    offset = np.float32(LOG_OFFSET)
    shadow = (np.concatenate([dark, bright]) + offset) * np.float32(0.4) - offset
    light = log_image(np.concatenate([dark, bright]))
    assert np.abs(np.diff(light, axis=0) - np.diff(log_image(shadow), axis=0)).max() < 3


@pytest.mark.parametrize('shape', [(64, 48), (65, 49), (16, 17)])
def test_a_pixel_of_the_pyramid_is_the_mean_of_four(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    first, second, third, _ = halved(image, 3)
    height, width = shape[0] // 2, shape[1] // 2
    assert first is image
    assert second.shape == (height, width)
    assert third.shape == (height // 2, width // 2)
    even = image[: 2 * height, : 2 * width].astype(float)
    means = even.reshape(height, 2, width, 2).mean(axis=(1, 3))
    assert np.abs(second - means).max() <= 0.5


def test_edges_lie_on_steps_and_point_to_the_bright_side() -> None:
    gray = np.full((60, 80), 40, np.uint8)
    gray[:, 41:] = 160
    edges = find_edges(log_image(gray))
    assert len(edges.x) >= 50
    assert set(edges.x) <= {40, 41}
    assert edges.unit_x == pytest.approx(1, abs=1e-6)
    assert edges.unit_y == pytest.approx(0, abs=1e-6)


def test_edges_of_large_images_are_listed_in_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    log = log_image(IMAGE)
    whole = find_edges(log).curved(6.0)
    monkeypatch.setattr(log_edges, '_BAND', 70 * log.shape[1])
    bands = [*edges_in_bands(log)]
    parts = LogEdges.joined(bands).curved(6.0)
    assert len(bands) == 5
    assert 1000 < len(whole.x) < len(find_edges(log).x)
    for name in ('x', 'y', 'unit_x', 'unit_y', 'strength'):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))


@pytest.mark.parametrize('contrast', [2, 3])
def test_contrast_multiplies_the_steps_of_a_logarithm(contrast: int) -> None:
    (multiplied,) = edges_in_bands(contrast * log_image(IMAGE))
    (edges,) = edges_in_bands(log_image(IMAGE), contrast)
    assert len(edges.x) > 1000
    assert np.array_equal(edges.marked, multiplied.marked)
    assert np.array_equal(edges.strength, multiplied.strength)


def test_gray_values_are_those_of_the_image() -> None:
    for image in (IMAGE, IMAGE.astype(np.float32)):
        pyramid = image_pyramid(image, 60.0)
        assert pyramid.gray.dtype == np.float32
        assert np.array_equal(pyramid.gray, IMAGE)
        assert pyramid.images[0] is image
