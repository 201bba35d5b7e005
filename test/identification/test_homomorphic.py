from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.identification.filtering import homomorphic
from ahf_ros.identification.filtering.homomorphic import (
    HomomorphicFilter,
    blur_taps,
    median_distance,
    transfer,
)
from ahf_ros.identification.filtering.settings import FilterSettings
from ahf_ros.vision.logarithm import logarithm
from support.fourier import distances, filtered_fft, filtered_logarithm_fft, response

SHAPES = [(16, 16), (17, 31), (101, 64), (64, 101), (300, 211), (140, 140)]
SPECTRA = [(16, 16), (16, 17), (21, 16), (31, 45), (64, 40), (1, 1), (1, 9), (40, 3)]
GAINS = [(1.0, 0.0), (1.2, 0.25), (2.8, 0.82), (3.7, 0.66), (4.0, 0.0), (1.0, 0.9)]


def scene(height: int, width: int, seed: int = 0) -> np.ndarray:
    """Return a striped scene with smooth edges and some noise, like a photograph."""
    generator = np.random.default_rng(seed)
    rows, columns = np.mgrid[:height, :width]
    light = np.where(columns // 9 % 2 == 0, 1.0, 0.2) * (0.5 + rows / height)
    paper = np.where(np.hypot(rows - height / 2, columns - width / 2) < height / 3, 0.1, 1.0)
    image = cv2.GaussianBlur(light * paper, (0, 0), 1.0) * 140
    return np.clip(image + generator.normal(0, 1, image.shape), 0, 255).astype(np.uint8)


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    """Return black and white pixels at random, the worst case of a cut kernel."""
    generator = np.random.default_rng(seed)
    return (generator.random((height, width)) > 0.5).astype(np.uint8) * 255


def filtered_logarithm(image: np.ndarray, *parameters: Any) -> np.ndarray:
    """Return s of Eq. (6) as the filter computes it."""
    prepared = HomomorphicFilter(image)
    blur = homomorphic._Blur.of(transfer(image.shape, *parameters), image.shape)
    whole = slice(0, image.shape[0])
    return homomorphic._filtered_rows(prepared._padded(blur), whole, blur, 0.0)


@pytest.mark.parametrize('gains', GAINS)
@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize(('image_of', 'bound'), [(scene, 0.0015), (noise, 0.008)])
def test_the_spatial_form_is_the_fourier_form(
    shape: tuple[int, int], gains: tuple[float, float], image_of: Any, bound: float
) -> None:
    image = image_of(*shape)
    spread = np.ptp(logarithm(image, FilterSettings().log_offset))
    spatial = filtered_logarithm(image, *gains)
    assert np.abs(spatial - filtered_logarithm_fft(image, *gains)).max() < bound * spread


@pytest.mark.parametrize('gains', GAINS)
@pytest.mark.parametrize('shape', SHAPES)
def test_the_filtered_image_is_that_of_the_fourier_form(
    shape: tuple[int, int], gains: tuple[float, float]
) -> None:
    image = scene(*shape)
    spatial = HomomorphicFilter(image).filtered(*gains)
    assert spatial.dtype == np.uint8
    assert spatial.shape == image.shape
    assert np.abs(spatial.astype(int) - filtered_fft(image, *gains)).max() <= 2


@pytest.mark.parametrize(
    ('cutoff', 'attenuation'), [(None, 0.3), (10.0, None), (4.0, 2.0), (60.0, 5.0), (0.3, 1.0)]
)
@pytest.mark.parametrize('shape', [(64, 101), (300, 211)])
def test_cutoff_and_attenuation_are_free(
    shape: tuple[int, int], cutoff: float | None, attenuation: float | None
) -> None:
    image = scene(*shape)
    arguments = (2.0, 0.4, cutoff, attenuation)
    spatial = filtered_logarithm(image, *arguments)
    reference = filtered_logarithm_fft(image, *arguments)
    assert np.abs(spatial - reference).max() < 0.02
    assert np.ptp(reference) > 0.5


@pytest.mark.parametrize('kind', [np.uint16, np.float32, np.float64])
def test_every_type_of_pixel_gives_the_8_bit_result(kind: Any) -> None:
    image = scene(70, 90)
    image[0, 0] = 255  # the range of the floats, too
    wide = (image.astype(kind) * 257).astype(kind)
    result = HomomorphicFilter(wide).filtered(1.4, 0.3)
    expected = HomomorphicFilter(image).filtered(1.4, 0.3)
    assert np.abs(result.astype(int) - expected).max() <= 1


def test_equal_gains_only_stretch_the_image() -> None:
    image = scene(30, 90)  # small enough for the mapping to see every pixel
    settings = FilterSettings(black_percentile=0, white_percentile=100)
    filtered = HomomorphicFilter(image, settings).filtered(1.0, 1.0)
    expected = (image.astype(float) - image.min()) / np.ptp(image) * 255
    assert np.abs(filtered - expected).max() <= 0.51


def test_the_filter_flattens_light() -> None:
    columns = np.arange(400)
    paper = np.where(columns // 4 % 2 == 0, 1.0, 0.2)
    light = np.exp(-columns / 130)
    image = np.tile(paper * light * 255, (64, 1))
    filtered = HomomorphicFilter(image).filtered(1.0, 0.1, cutoff=20.0, attenuation=1.0)
    bright, dark = filtered[:, 40:360][:, paper[40:360] == 1], filtered[:, paper == 0.2][:, 20:-20]
    assert image[:, 40:360][:, paper[40:360] == 1].min() < image[:, paper == 0.2].max()
    assert bright.min() > dark.max()


@pytest.mark.parametrize('threads', [1, 2, 4])
def test_the_result_does_not_depend_on_the_threads(threads: int) -> None:
    image = scene(600, 301)
    expected = HomomorphicFilter(image).filtered(2.8, 0.82)
    with ThreadPoolExecutor(threads) as executor:
        result = HomomorphicFilter(image).filtered(2.8, 0.82, executor=executor)
    np.testing.assert_array_equal(result, expected)


def test_one_image_is_filtered_from_several_threads_at_once() -> None:
    prepared = HomomorphicFilter(scene(200, 301))
    gains = [(1 + step / 10, step / 40) for step in range(30)]
    expected = [prepared.filtered(*pair) for pair in gains]
    with ThreadPoolExecutor(4) as executor:
        for result, right in zip(
            executor.map(lambda pair: prepared.filtered(*pair), gains), expected, strict=True
        ):
            np.testing.assert_array_equal(result, right)


def test_the_image_is_not_kept() -> None:
    image = scene(70, 90)
    prepared = HomomorphicFilter(image)
    before = prepared.filtered(2.0, 0.5)
    image[:] = 0
    np.testing.assert_array_equal(prepared.filtered(2.0, 0.5), before)


@pytest.mark.parametrize('view', [np.s_[::-1], np.s_[:, ::-1], np.s_[::2, ::2], np.s_[5:40, 3:60]])
@pytest.mark.parametrize('kind', [np.uint8, np.uint16, np.float32])
def test_any_strides_will_do(view: Any, kind: Any) -> None:
    image = scene(70, 90).astype(kind)
    copied = np.ascontiguousarray(image[view])
    np.testing.assert_array_equal(
        HomomorphicFilter(image[view]).filtered(2.0, 0.5),
        HomomorphicFilter(copied).filtered(2.0, 0.5),
    )


def test_a_strong_filter_saturates_instead_of_overflowing() -> None:
    filtered = HomomorphicFilter(noise(64, 64)).filtered(40.0, 0.0)
    assert set(np.unique(filtered[scene(64, 64) >= 0])) >= {0, 255}


@pytest.mark.parametrize('speck', [0, 255])
def test_a_speck_on_even_ground_is_still_seen(speck: int) -> None:
    image = np.full((300, 200), 128, np.uint8)
    image[150, 100] = speck
    filtered = HomomorphicFilter(image).filtered(1.2, 0.25).astype(int)
    assert filtered[150, 100] == speck
    assert abs(filtered[10, 10] - 128) < 10


def test_a_filter_out_of_range_is_refused() -> None:
    prepared = HomomorphicFilter(scene(32, 32))
    with pytest.raises(ValueError, match='gamma_low is 3'):
        prepared.filtered(2.0, 3.0)
    with pytest.raises(ValueError, match='cutoff is -1'):
        prepared.filtered(2.0, 0.5, cutoff=-1.0)


@pytest.mark.parametrize('shape', SPECTRA)
def test_distances_are_measured_from_the_centre_of_the_shifted_spectrum(
    shape: tuple[int, int],
) -> None:
    height, width = shape
    rows, columns = np.mgrid[:height, :width]
    centred = np.hypot(rows - height // 2, columns - width // 2)
    np.testing.assert_array_equal(np.fft.fftshift(distances(*shape)), centred)


@pytest.mark.parametrize('shape', SPECTRA)
def test_median_distance_is_the_median(shape: tuple[int, int]) -> None:
    assert median_distance(*shape) == pytest.approx(np.median(distances(*shape)), rel=1e-15)


def test_median_distance_at_the_size_of_the_paper() -> None:
    assert median_distance(2656, 3984) == pytest.approx(1297.7276293583334, rel=1e-15)


def test_published_values_are_the_default() -> None:
    filled = transfer((40, 60), 2.8, 0.82)
    assert filled.cutoff == median_distance(40, 60)
    assert filled.attenuation == 2.8 - 0.82


def test_the_response_runs_from_the_low_to_the_high_gain() -> None:
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
def test_a_number_out_of_range_is_refused_by_name(values: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        transfer((40, 60), **{'gamma_high': 2.0, 'gamma_low': 0.5, **values})


@pytest.mark.parametrize('length', [16, 17, 100, 101])
@pytest.mark.parametrize('attenuation', [0.0, 0.2, 1.0, 4.0])
def test_all_taps_together_are_the_fourier_filter(
    length: int, attenuation: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(homomorphic, '_TOLERANCE', 0)
    signal = np.random.default_rng(1).normal(size=length)
    gaussian = np.exp(-attenuation * (np.fft.fftfreq(length) / 0.4) ** 2)
    expected = np.fft.ifft(np.fft.fft(signal) * gaussian).real
    taps = blur_taps(length, attenuation, 0.4 * length)
    periodic = np.pad(signal, len(taps) // 2, mode='wrap')
    np.testing.assert_allclose(np.convolve(periodic, taps, 'valid'), expected, atol=1e-13)


@pytest.mark.parametrize('attenuation', [0.01, 0.5, 1.0, 2.0, 4.0])
@pytest.mark.parametrize('share', [0.33, 0.05])
def test_cut_taps_are_symmetric_few_and_sum_to_one(attenuation: float, share: float) -> None:
    taps = blur_taps(1000, attenuation, share * 1000)
    assert taps.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(taps, taps[::-1])
    assert len(taps) < 70


def test_without_attenuation_one_tap_is_left() -> None:
    np.testing.assert_array_equal(blur_taps(100, 0.0, 30.0), [1.0])
