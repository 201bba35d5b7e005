"""Homomorphic filtering of one image with many filters.

The filter of [1]_ (Eq. 1 to 7) is z = ln f, S = H F(z), g = exp s with a Gaussian H:

    H = gamma_high - d exp(-c (D / D0)^2),  d = gamma_high - gamma_low

The Gaussian separates, so s = gamma_high z - d (G * z), where G * is one circular convolution
along the rows and one along the columns. Per image the logarithm is taken once, and per distinct
pair (c, D0) one blur G * z; by default c = d and D0 is the median of D, and only d asks for a new
one. `filtered_fft` is the published form, kept as the reference.

Two steps that the paper leaves open are settled here:

- The offset. z = ln(f / range + offset), because f may be 0. The range is 255 for 8-bit images; for
  16-bit images the largest number of their bit depth, which is the smallest from 8 to 16 that holds
  every pixel; for float images their largest value. Dividing by it only scales g, by a constant.
- The output mapping. g goes to 8 bit linearly, with one percentile of g at 0 and another at 255, both
  taken over the same `SAMPLES` pixels of every image of a size.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import lru_cache
from threading import Lock

import cv2
import numpy as np

from ahf_ros.image import check_image
from ahf_ros.parameter import check_parameters, parameter
from ahf_ros.spectrum import blur_taps, median_distance, transfer

SAMPLES = 32768
"""Number of pixels that the output mapping looks at."""

MINIMUM_CONTRAST = 1e-4
"""Smallest difference of s between black and white; a flatter image is not stretched further."""

BLURS = 4
"""Number of blurred logarithms that a `HomomorphicFilter` keeps, 4 bytes a pixel each."""

STRIP = 48
"""Rows that are processed at once: few enough to stay in the cache of a core."""


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """How an image enters the logarithm and how the filtered image becomes 8-bit."""

    log_offset: float = parameter(
        1 / 255,
        'Added to the image before the logarithm, as a share of the range of the image.',
        minimum=1e-6,
        maximum=1.0,
    )
    black_percentile: float = parameter(
        0.5, 'Percentile of the filtered image that turns black.', minimum=0.0, maximum=49.0
    )
    white_percentile: float = parameter(
        99.5, 'Percentile of the filtered image that turns white.', minimum=51.0, maximum=100.0
    )

    def __post_init__(self) -> None:
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class Transfer:
    """The numbers of one filter, all of them set.

    Attributes
    ----------
    gamma_high, gamma_low : float
        Gains of the high and the low frequencies, dimensionless.
    cutoff : float
        D0, cycles per image.
    attenuation : float
        c, dimensionless.
    """

    gamma_high: float
    gamma_low: float
    cutoff: float
    attenuation: float


def transfer_of(
    shape: tuple[int, int],
    gamma_high: float,
    gamma_low: float,
    cutoff: float | None = None,
    attenuation: float | None = None,
) -> Transfer:
    """Return the filter with what is not given at its published value.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    gamma_high, gamma_low : float
        Gains of the high and the low frequencies, 0 <= gamma_low <= gamma_high, gamma_high > 0.
    cutoff : float, optional
        D0, cycles per image, > 0; the median of D where not given.
    attenuation : float, optional
        c, > 0; gamma_high - gamma_low (Eq. 8) where not given.

    Raises
    ------
    ValueError
        If a value is out of its range or not finite.
    """
    _check_number('gamma_high', gamma_high, gamma_high > 0, 'above 0')
    within = 0 <= gamma_low <= gamma_high
    _check_number('gamma_low', gamma_low, within, f'from 0 to gamma_high, {gamma_high:g}')
    if cutoff is None:
        cutoff = median_distance(*shape)
    _check_number('cutoff', cutoff, cutoff > 0, 'above 0')
    if attenuation is None:
        # rounded so that equal differences in decimals share one blur
        attenuation = round(gamma_high - gamma_low, 9)
    else:
        _check_number('attenuation', attenuation, attenuation > 0, 'above 0')
    return Transfer(float(gamma_high), float(gamma_low), float(cutoff), float(attenuation))


def logarithm(image: np.ndarray, offset: float) -> np.ndarray:
    """Return z = ln(image / range + offset), float32; 8- and 16-bit images by look-up."""
    if image.dtype.kind == 'f':
        share = (image / image.max()).astype(np.float32)
        return np.log(share + np.float32(offset))
    depth = 8 if image.dtype == np.uint8 else max(8, int(image.max()).bit_length())
    share = np.arange(2**depth) / (2**depth - 1)
    table = np.log(share + offset).astype(np.float32)
    return cv2.LUT(image, table) if image.dtype == np.uint8 else table[image]


class HomomorphicFilter:
    """One image, ready to be filtered many times and from several threads.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        As `ahf_ros.image.check_image` accepts it. It is not kept.
    settings : FilterSettings
        Offset and output mapping.
    executor : concurrent.futures.Executor, optional
        Threads that share the strips of one filtered image. Never the one whose threads call
        `filtered`: they would wait for themselves. The result does not depend on it.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """

    def __init__(
        self,
        image: np.ndarray,
        settings: FilterSettings | None = None,
        executor: Executor | None = None,
    ) -> None:
        check_image(image)
        self.settings = settings or FilterSettings()
        self.shape: tuple[int, int] = image.shape
        self._executor = executor
        self._logarithm = logarithm(image, self.settings.log_offset)
        self._samples = _sampled(self._logarithm)
        self._blurs: dict[tuple[float, float], _Blur] = {}
        self._lock = Lock()

    def filtered(
        self,
        gamma_high: float,
        gamma_low: float,
        cutoff: float | None = None,
        attenuation: float | None = None,
    ) -> np.ndarray:
        """Return g of Eq. (7), mapped to 8 bit.

        Parameters
        ----------
        gamma_high, gamma_low, cutoff, attenuation
            As for `transfer_of`.

        Returns
        -------
        ndarray of uint8, shape (height, width)

        Raises
        ------
        ValueError
            If a parameter is out of its range.
        """
        chosen = transfer_of(self.shape, gamma_high, gamma_low, cutoff, attenuation)
        blurred = self._blurred(chosen)
        samples = _combined(self._samples, _sampled(blurred), chosen)
        scale, zero = _mapping(samples, self.settings)
        image = np.empty(self.shape, np.uint8)

        def fill(rows: slice) -> None:
            values = _combined(self._logarithm[rows], blurred[rows], chosen, scale)
            cv2.exp(values, values)
            cv2.addWeighted(values, 1, values, 0, -zero, image[rows], cv2.CV_8U)

        self._in_strips(fill)
        return image

    def filtered_logarithm(
        self,
        gamma_high: float,
        gamma_low: float,
        cutoff: float | None = None,
        attenuation: float | None = None,
    ) -> np.ndarray:
        """Return s of Eq. (6), float32, shape (height, width).

        Within 0.003 (max z - min z) of `filtered_logarithm_fft` for any image and the published
        parameters, and within 0.001 (max z - min z) for photographs.
        """
        chosen = transfer_of(self.shape, gamma_high, gamma_low, cutoff, attenuation)
        return _combined(self._logarithm, self._blurred(chosen), chosen)

    def _blurred(self, chosen: Transfer) -> np.ndarray:
        """Return G * z, from the `BLURS` used last where it is among them."""
        key = (chosen.attenuation, chosen.cutoff)
        with self._lock:
            blur = self._blurs.pop(key, None) or _Blur()
            self._blurs[key] = blur  # the last used is the last of the dictionary
            if len(self._blurs) > BLURS:
                del self._blurs[next(iter(self._blurs))]
        with blur.lock:
            if blur.values is None:
                blur.values = self._blur(*key)
            return blur.values

    def _blur(self, attenuation: float, cutoff: float) -> np.ndarray:
        height, width = self.shape
        column = blur_taps(height, attenuation, cutoff).astype(np.float32)
        row = blur_taps(width, attenuation, cutoff).astype(np.float32)
        above, beside = len(column) // 2, len(row) // 2
        blurred = np.empty(self.shape, np.float32)

        def fill(rows: slice) -> None:
            strip = _rows_around(self._logarithm, rows, above)
            strip = cv2.copyMakeBorder(strip, 0, 0, beside, beside, cv2.BORDER_WRAP)
            strip = cv2.sepFilter2D(strip, cv2.CV_32F, row, column)
            blurred[rows] = strip[above : len(strip) - above, beside : beside + width]

        self._in_strips(fill)
        return blurred

    def _in_strips(self, fill: Callable[[slice], None]) -> None:
        height = self.shape[0]
        strips = [slice(top, min(top + STRIP, height)) for top in range(0, height, STRIP)]
        for _ in (self._executor.map if self._executor else map)(fill, strips):
            pass


def filtered_fft(
    image: np.ndarray,
    gamma_high: float,
    gamma_low: float,
    cutoff: float | None = None,
    attenuation: float | None = None,
    settings: FilterSettings | None = None,
) -> np.ndarray:
    """Return what `HomomorphicFilter.filtered` returns, by Fourier transforms in double precision.

    The reference: Eq. (1) to (7) as they stand, some 30 times slower.

    Parameters
    ----------
    image, settings
        As for `HomomorphicFilter`.
    gamma_high, gamma_low, cutoff, attenuation
        As for `transfer_of`.

    Returns
    -------
    ndarray of uint8, shape (height, width)
    """
    settings = settings or FilterSettings()
    values = filtered_logarithm_fft(image, gamma_high, gamma_low, cutoff, attenuation, settings)
    scale, zero = _mapping(_sampled(values), settings)
    return np.clip(np.rint(np.exp(values + scale) - zero), 0, 255).astype(np.uint8)


def filtered_logarithm_fft(
    image: np.ndarray,
    gamma_high: float,
    gamma_low: float,
    cutoff: float | None = None,
    attenuation: float | None = None,
    settings: FilterSettings | None = None,
) -> np.ndarray:
    """Return s of Eq. (6) by Fourier transforms, float64, shape (height, width)."""
    check_image(image)
    settings = settings or FilterSettings()
    height, width = image.shape
    chosen = transfer_of((height, width), gamma_high, gamma_low, cutoff, attenuation)
    response = transfer(
        height, width, chosen.gamma_high, chosen.gamma_low, chosen.cutoff, chosen.attenuation
    )
    spectrum = np.fft.fft2(logarithm(image, settings.log_offset).astype(np.float64))
    return np.fft.ifft2(response * spectrum).real


@dataclass(slots=True)
class _Blur:
    """A blurred logarithm, or the promise of one; the thread that holds the lock makes it."""

    lock: Lock = field(default_factory=Lock)
    values: np.ndarray | None = None


def _combined(
    logarithm: np.ndarray, blurred: np.ndarray, chosen: Transfer, shift: float = 0.0
) -> np.ndarray:
    """Return s + shift."""
    difference = chosen.gamma_high - chosen.gamma_low
    return cv2.addWeighted(logarithm, chosen.gamma_high, blurred, -difference, shift)


def _mapping(samples: np.ndarray, settings: FilterSettings) -> tuple[float, float]:
    """Return `scale` and `zero` with which exp(s + scale) - zero is the 8-bit image."""
    percentiles = (settings.black_percentile, settings.white_percentile)
    black, white = (float(value) for value in np.percentile(samples, percentiles))
    contrast = max(white - black, MINIMUM_CONTRAST)
    zero = 255 / math.expm1(contrast)
    return math.log(zero) - black, zero


@lru_cache(maxsize=4)
def _sample_positions(size: int) -> np.ndarray:
    if size <= SAMPLES:
        return np.arange(size)
    # at random, because a regular grid would fall in step with projected stripes
    return np.sort(np.random.default_rng(0).integers(size, size=SAMPLES))


def _sampled(values: np.ndarray) -> np.ndarray:
    return values.ravel()[_sample_positions(values.size)]


def _rows_around(values: np.ndarray, rows: slice, margin: int) -> np.ndarray:
    """Return `rows` of `values` and `margin` more on either side, the rows being periodic."""
    top, bottom = rows.start - margin, rows.stop + margin
    if top >= 0 and bottom <= len(values):
        return values[top:bottom]
    return values.take(range(top, bottom), axis=0, mode='wrap')


def _check_number(name: str, value: float, accepted: bool, words: str) -> None:
    if not (accepted and math.isfinite(value)):
        raise ValueError(f'{name} is {value!r}, accepted is a number {words}')
