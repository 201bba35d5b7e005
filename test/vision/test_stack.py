"""Combinations of images of one scene."""

from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.vision.stack import COMBINATIONS, ImageStack

REFLECTANCE = np.tile(np.array([10, 200], np.uint8), (20, 16))


def lit(phase: int, kind: type = np.uint8, white: int = 255) -> np.ndarray:
    """Return a print; every other pair of columns is lit."""
    light = np.where((np.arange(32) // 2 + phase) % 2, 1.0, 0.1)
    return np.rint(REFLECTANCE * light * (white / 255)).astype(kind)


def both(**options: Any) -> ImageStack:
    return ImageStack((lit(0, **options), lit(1, **options)))


def test_the_largest_values_show_the_print_in_full_light() -> None:
    assert np.array_equal(both().combined('largest'), REFLECTANCE)


def test_means_are_of_light_or_of_gray() -> None:
    stack = both()
    gray = np.rint((lit(0).astype(float) + lit(1)) / 2)
    assert np.array_equal(stack.combined('mean_gray'), gray)
    light = ((lit(0) / 255.0) ** 2.2 + (lit(1) / 255.0) ** 2.2) / 2
    expected = 255 * light ** (1 / 2.2)
    assert np.abs(stack.combined('mean_light') - expected).max() <= 0.51


def test_the_quotient_shows_what_shines_in_one_of_the_lights() -> None:
    dark = np.tile(np.arange(30, 50, dtype=np.uint8), (20, 1))
    bright = dark.copy()
    bright[5:10, 5:10] = 240
    quotient = ImageStack((dark, bright, dark)).combined('quotient')
    assert quotient[7, 7] > 200
    assert quotient[0, 0] == 0


@pytest.mark.parametrize(
    ('kind', 'white'), [(np.uint16, 4095), (np.float32, 3.0), (np.float64, 7e5)]
)
@pytest.mark.parametrize('name', ['even_light', 'largest', 'mean_light', 'mean_gray'])
def test_combinations_have_the_pixels_of_the_images(kind: Any, white: float, name: str) -> None:
    images = tuple((lit(phase) / 255 * white).astype(kind) for phase in (0, 1))
    combined = ImageStack(images).combined(name)
    assert combined.dtype == kind
    assert np.allclose(combined, both().combined(name) / 255 * white, atol=0.02 * white)


@pytest.mark.parametrize('name', COMBINATIONS)
def test_the_order_of_the_images_and_their_memory_do_not_matter(name: str) -> None:
    first, second = lit(0), np.asfortranarray(lit(1))
    combined = ImageStack((first, second)).combined(name)
    assert combined.flags.c_contiguous
    turned = ImageStack((second[::-1], first[::-1])).combined(name)[::-1]
    assert np.abs(combined.astype(int) - turned).max() <= 1


def test_one_image_is_its_own_combination() -> None:
    image = lit(0)
    stack = ImageStack((image,))
    assert stack.names == ('',)
    assert stack.combined('') is image


def test_averaging_reduces_noise() -> None:
    generator = np.random.default_rng(0)
    clean = cv2.GaussianBlur(np.tile(REFLECTANCE, (3, 2)), (0, 0), 3).astype(float)
    images = [clean + generator.normal(0, 4, clean.shape) for _ in range(16)]
    noisy = tuple(np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in images)
    combined = ImageStack(noisy).combined('mean_gray')
    assert (combined - clean).std() < (noisy[0] - clean).std() / 3


@pytest.mark.parametrize(
    ('images', 'message'),
    [
        ((), 'stack has 0 images, accepted is a number from 1 to 64'),
        ((lit(0),) * 65, 'stack has 65 images'),
        (
            (lit(0), lit(1)[:, :-1]),
            'image 2 of the stack is 31 x 20 px, accepted is the size of the first, 32 x 20 px',
        ),
        (
            (lit(0), lit(1, np.uint16)),
            'image 2 of the stack has pixels of type uint16, accepted is the type of the first',
        ),
        ((lit(0), np.zeros_like(lit(0))), 'image 2 of the stack is constant, 0 everywhere'),
        ((lit(0)[0],), r'image has shape \(32,\)'),
    ],
)
def test_images_that_do_not_fit_are_named(images: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ImageStack(images)


def test_an_unknown_combination_is_refused() -> None:
    with pytest.raises(ValueError, match="combination is 'sum', accepted is one of even_light"):
        both().combined('sum')
