import math
from typing import Any

import numpy as np
import pytest

from ahf_ros.vision.logarithm import MINIMUM_CONTRAST, logarithm, mapping, sample_lattice
from support.fourier import sampled

RAMP = np.arange(256, dtype=np.uint8).reshape(16, 16)


@pytest.mark.parametrize(
    ('depth', 'kind'), [(8, np.uint8), *((depth, np.uint16) for depth in (8, 10, 12, 16))]
)
def test_the_range_of_integers_is_that_of_their_depth(depth: int, kind: Any) -> None:
    image = (RAMP / 255 * (2**depth - 1)).astype(kind)
    expected = np.log(image / (2**depth - 1) + 0.01)
    np.testing.assert_allclose(logarithm(image, 0.01), expected, rtol=0, atol=1e-6)


def test_a_dark_16_bit_image_is_not_taken_for_a_bright_one() -> None:
    image = RAMP.astype(np.uint16) // 8
    assert logarithm(image, 0.01).max() == pytest.approx(math.log(31 / 255 + 0.01), abs=1e-6)


@pytest.mark.parametrize('kind', [np.float32, np.float64])
@pytest.mark.parametrize('unit', [1e-30, 1.0, 1e30])
def test_the_unit_of_a_float_image_does_not_matter(kind: Any, unit: float) -> None:
    expected = np.log(RAMP / 255 + 0.01)
    image = (RAMP * kind(unit)).astype(kind)
    np.testing.assert_allclose(logarithm(image, 0.01), expected, rtol=0, atol=1e-5)


def test_the_largest_float_is_not_too_large() -> None:
    image = RAMP / 255 * np.finfo(np.float64).max
    np.testing.assert_allclose(logarithm(image, 0.01), np.log(RAMP / 255 + 0.01), atol=1e-5)


def test_the_mapping_puts_its_percentiles_at_black_and_white() -> None:
    samples = np.log(np.linspace(3, 7, 1001))
    scale, zero = mapping(samples, 10, 90)
    mapped = np.exp(samples + scale) - zero
    assert mapped[100] == pytest.approx(0, abs=1e-6)
    assert mapped[900] == pytest.approx(255, abs=1e-6)
    assert np.ptp(np.diff(mapped)) == pytest.approx(0, abs=1e-6)  # linear in exp s


def test_a_flat_image_is_not_stretched_to_its_rounding() -> None:
    samples = np.full(100, 0.7) + np.linspace(0, MINIMUM_CONTRAST / 100, 100)
    scale, zero = mapping(samples, 0, 100)
    mapped = np.exp(samples + scale) - zero
    assert 125 < mapped.min() < mapped.max() < 130


@pytest.mark.parametrize('shape', [(16, 20), (33, 2000), (2656, 3984)])
def test_the_lattice_is_inside_ascending_and_the_same_every_time(shape: tuple[int, int]) -> None:
    for places, length in zip(sample_lattice(*shape), shape, strict=True):
        assert places[0] >= 0
        assert places[-1] < length
        assert (np.diff(places) > 0).all()
    sample_lattice.cache_clear()
    again = sample_lattice(*shape)
    np.testing.assert_array_equal(sample_lattice(*shape)[0], again[0])


def test_every_pixel_of_a_small_image_is_looked_at() -> None:
    np.testing.assert_array_equal(sampled(RAMP), RAMP)


def test_stripes_of_any_period_are_sampled_at_every_phase() -> None:
    columns = sample_lattice(2656, 3984)[1]
    for period in range(2, 100):
        assert len(set(columns % period)) == period
