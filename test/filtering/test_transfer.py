from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.filtering.transfer import blur_kernel, blur_taps, median_distance, transfer
from support.fourier import distances, response

SHAPES = [(16, 16), (16, 17), (21, 16), (31, 45), (64, 40), (1, 1), (1, 9), (40, 3)]


def test_distances_of_a_small_spectrum():
    # frequencies 0, 1, -2, -1 down and 0, 1, -1 across
    expected = np.sqrt([[0, 1, 1], [1, 2, 2], [4, 5, 5], [1, 2, 2]])
    np.testing.assert_array_equal(distances(4, 3), expected)


@pytest.mark.parametrize('shape', SHAPES)
def test_distances_are_measured_from_the_centre_of_the_shifted_spectrum(shape):
    height, width = shape
    rows, columns = np.mgrid[:height, :width]
    centred = np.hypot(rows - height // 2, columns - width // 2)
    np.testing.assert_array_equal(np.fft.fftshift(distances(*shape)), centred)


@pytest.mark.parametrize('shape', SHAPES)
def test_median_distance_is_the_median(shape):
    assert median_distance(*shape) == pytest.approx(np.median(distances(*shape)), rel=1e-15)


def test_median_distance_at_the_size_of_the_paper():
    assert median_distance(2656, 3984) == pytest.approx(1297.7276293583334, rel=1e-15)


def test_published_values_are_the_default():
    filled = transfer((40, 60), 2.8, 0.82)
    assert filled.cutoff == median_distance(40, 60)
    assert filled.attenuation == 2.8 - 0.82


def test_the_response_runs_from_the_low_to_the_high_gain():
    gains = response((32, 48), transfer((32, 48), 3.0, 0.5, cutoff=2.0, attenuation=1.5))
    assert gains[0, 0] == 0.5
    assert gains[0, 2] == pytest.approx(2.5 * (1 - np.exp(-1.5)) + 0.5)
    assert gains[16, 24] == pytest.approx(3.0)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'gamma_high': 0.0}, 'gamma_high is 0.0, accepted is a number above 0'),
        ({'gamma_high': float('inf')}, 'gamma_high is inf'),
        ({'gamma_high': float('nan')}, 'gamma_high is nan'),
        ({'gamma_low': -0.1}, 'gamma_low is -0.1, accepted is a number from 0 to gamma_high, 2'),
        ({'gamma_low': 2.1}, 'gamma_low is 2.1'),
        ({'gamma_low': float('nan')}, 'gamma_low is nan'),
        ({'cutoff': 0.0}, 'cutoff is 0.0, accepted is a number above 0'),
        ({'cutoff': float('nan')}, 'cutoff is nan'),
        ({'attenuation': -0.1}, 'attenuation is -0.1, accepted is a number of at least 0'),
        ({'attenuation': float('inf')}, 'attenuation is inf'),
    ],
)
def test_a_number_out_of_range_is_refused_by_name(values, words):
    with pytest.raises(ValueError, match=words):
        transfer((40, 60), **{'gamma_high': 2.0, 'gamma_low': 0.5, **values})


@pytest.mark.parametrize('length', [16, 17, 100, 101])
def test_the_kernel_has_the_gaussian_as_its_spectrum(length):
    frequencies = np.fft.fftfreq(length) * length
    spectrum = np.fft.fft(blur_kernel(length, 1.3, 0.4 * length))
    np.testing.assert_allclose(
        spectrum, np.exp(-1.3 * (frequencies / (0.4 * length)) ** 2), rtol=0, atol=1e-14
    )


@pytest.mark.parametrize('length', [16, 17, 100, 101])
@pytest.mark.parametrize('attenuation', [0.0, 0.2, 1.0, 4.0])
def test_all_taps_together_are_the_fourier_filter(length, attenuation):
    signal = np.random.default_rng(1).normal(size=length)
    gaussian = np.exp(-attenuation * (np.fft.fftfreq(length) / 0.4) ** 2)
    expected = np.fft.ifft(np.fft.fft(signal) * gaussian).real
    taps = blur_taps(length, attenuation, 0.4 * length, tolerance=0)
    periodic = np.pad(signal, len(taps) // 2, mode='wrap')
    np.testing.assert_allclose(np.convolve(periodic, taps, 'valid'), expected, atol=1e-13)


@pytest.mark.parametrize('attenuation', [0.01, 0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize('share', [0.33, 0.05])
def test_cut_taps_are_symmetric_few_and_sum_to_one(attenuation, share):
    taps = blur_taps(1000, attenuation, share * 1000)
    assert taps.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(taps, taps[::-1])
    assert len(taps) < 70


def test_without_attenuation_one_tap_is_left():
    np.testing.assert_array_equal(blur_taps(100, 0.0, 30.0), [1.0])


@pytest.mark.parametrize(
    ('attenuation', 'cutoff', 'words'),
    [(1.0, 0.0, 'cutoff is 0'), (1.0, float('nan'), 'cutoff'), (-1.0, 3.0, 'attenuation is -1')],
)
def test_a_kernel_needs_a_cutoff_and_an_attenuation(attenuation, cutoff, words):
    with pytest.raises(ValueError, match=words):
        blur_kernel(32, attenuation, cutoff)
