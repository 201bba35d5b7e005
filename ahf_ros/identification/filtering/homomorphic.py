"""Homomorphic filtering of one image with many filters.

The filter of [1]_ (Eq. 1 to 7) is z = ln f, S = H F(z), g = exp s with a Gaussian H:

    H = gamma_high - d exp(-c (D / D0)^2),  d = gamma_high - gamma_low

The Gaussian is separable, so s = gamma_high z - d (G * z), where G * is a circular convolution
along the rows and one along the columns. The logarithm is taken once per image; each filter then
passes over it once, in strips of rows that stay in the cache of a core. By default c = d and D0 is
the median of D. `support.fourier` has the published form, with which tests compare.

Two steps that the paper leaves open are defined here:

- Offset: z = ln(f / range + offset), because f may be 0. `ahf_ros.vision.logarithm.logarithm`
  defines the range. The division scales g by a constant.
- Output mapping: g is mapped linearly to 8 bit, one percentile of g to 0 and another to 255. Both
  are taken on a lattice of rows and columns that depends on the size of the image only.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ahf_ros.base.target import FilterState
from ahf_ros.identification.filtering.settings import FilterSettings
from ahf_ros.vision.image import check_image
from ahf_ros.vision.logarithm import logarithm, mapping, sample_lattice

_TOLERANCE = 1e-3  # weight of a kernel, of 1, beyond its last tap: errors within one gray level
_MARGIN = 12  # width of the periodic border around a logarithm, px; few filters reach further
_STRIP = 128  # rows that are processed at once, few enough to stay in the cache of a core


@dataclass(frozen=True, slots=True)
class Transfer:
    """Parameters of one filter: its gains, D0 in cycles per image, and c."""

    gamma_high: float
    gamma_low: float
    cutoff: float
    attenuation: float


def transfer(
    shape: tuple[int, int],
    gamma_high: float,
    gamma_low: float,
    cutoff: float | None = None,
    attenuation: float | None = None,
) -> Transfer:
    """Return a filter for images of a height and width in px.

    By default D0 is the median of D and c = gamma_high - gamma_low (Eq. 8), as published. Raises a
    ValueError unless 0 <= gamma_low <= gamma_high, gamma_high > 0, cutoff > 0, attenuation >= 0
    and all are finite.
    """
    _check_number('gamma_high', gamma_high, gamma_high > 0, 'above 0')
    within = 0 <= gamma_low <= gamma_high
    _check_number('gamma_low', gamma_low, within, f'from 0 to gamma_high, {gamma_high:g}')
    if cutoff is None:
        cutoff = median_distance(*shape)
    _check_number('cutoff', cutoff, cutoff > 0, 'above 0')
    if attenuation is None:
        attenuation = gamma_high - gamma_low
    _check_number('attenuation', attenuation, attenuation >= 0, 'of at least 0')
    return Transfer(
        gamma_high=float(gamma_high),
        gamma_low=float(gamma_low),
        cutoff=float(cutoff),
        attenuation=float(attenuation),
    )


def _check_number(name: str, value: float, accepted: bool, range_: str) -> None:
    if not (accepted and math.isfinite(value)):
        raise ValueError(f'{name} is {value!r}, accepted is a number {range_}')


@lru_cache(maxsize=64)
def median_distance(height: int, width: int) -> float:
    """Return the exact median of D, the published cut-off D0, in cycles per image.

    D(u, v) is the distance of a frequency from the centre of the spectrum. Its squares are
    integers, so the middle order statistics are found by bisection on the number of frequencies
    in a disc, without sorting the spectrum.
    """
    count = height * width
    ranks = ((count - 1) // 2, count // 2)
    lower, upper = (np.sqrt(_square_of_rank(height, width, rank)) for rank in ranks)
    return float(lower + upper) / 2


def _square_of_rank(height: int, width: int, rank: int) -> int:
    """Return the squared distance of a rank, from 0, in ascending order."""
    rows = (np.arange(height) - height // 2) ** 2
    low, high = 0, (height // 2) ** 2 + (width // 2) ** 2
    while low < high:
        square = (low + high) // 2
        inside = rows[rows <= square]
        radius = np.sqrt(square - inside).astype(np.int64)
        count = np.minimum(radius, width // 2) + np.minimum(radius, (width - 1) // 2) + 1
        if count.sum() > rank:
            high = square
        else:
            low = square + 1
    return low


def blur_taps(length: int, attenuation: float, cutoff: float) -> np.ndarray:
    """Return the kernel of `length` samples whose DFT is exp(-c (u / D0)^2), cut at its ends.

    The Gaussian of Eq. (4) separates into one factor an axis, so the two-dimensional Fourier
    filter is exactly two one-dimensional circular convolutions. The spectrum ends at the Nyquist
    frequency, where it is not yet zero, so the kernel has an endless tail (-1)^k / k^2. The weight
    beyond the last tap is added to the last tap: constants pass exactly, and slow changes better
    than with a kernel twice as long.

    Returns
    -------
    ndarray of float64, shape (2 reach + 1,)
        Symmetric about the middle, sums to one; reach <= length // 2.
    """
    frequencies = np.fft.ifftshift(np.arange(length) - length // 2).astype(np.float64)
    kernel = np.fft.ifft(np.exp(-attenuation * (frequencies / cutoff) ** 2)).real
    half = kernel[: length // 2 + 1].copy()
    if length % 2 == 0:
        half[-1] /= 2  # the sample opposite the centre belongs to both halves
    beyond = 1 - (2 * np.cumsum(half) - half[0])
    above = np.flatnonzero(np.abs(beyond[:-1]) > _TOLERANCE)
    reach = int(above[-1]) + 1 if above.size else 0
    taps = half[: reach + 1]
    taps[reach] += beyond[reach] / (2 if reach else 1)
    return np.concatenate([taps[:0:-1], taps])


class HomomorphicFilter:
    """One image, prepared to be filtered many times; thread-safe.

    The image is one that `ahf_ros.vision.image.check_image` accepts, a ValueError is raised
    otherwise; no reference is kept.

    Notes
    -----
    Blurs are not cached for later filters with the same d. Only 2 to 4 % of the filters of a
    genetic search would find their blur among the last eight. Each takes 42 MB at 10.6 MP, and
    writing it for the other filters costs more than it saves.

    Examples
    --------
    >>> image = np.add.outer(np.arange(40.0), np.arange(60.0) % 7)
    >>> filtered = HomomorphicFilter(image).filtered(gamma_high=2.0, gamma_low=0.5)
    >>> filtered.shape, filtered.dtype
    ((40, 60), dtype('uint8'))
    """

    def __init__(self, image: np.ndarray, settings: FilterSettings | None = None) -> None:
        check_image(image)
        self.settings = settings or FilterSettings()
        self.shape: tuple[int, int] = image.shape
        values = logarithm(image, self.settings.log_offset)
        self._margined = cv2.copyMakeBorder(values, *(_MARGIN,) * 4, cv2.BORDER_WRAP)

    def filtered(
        self,
        gamma_high: float,
        gamma_low: float,
        cutoff: float | None = None,
        attenuation: float | None = None,
        executor: Executor | None = None,
    ) -> np.ndarray:
        """Return g of Eq. (7), mapped to 8 bit, for the parameters of `transfer`.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Threads that share the strips of the image; they do not change the result. Must not
            be the executor that runs this call, which would wait for itself.

        Returns
        -------
        ndarray of uint8, shape (height, width)
            For photographs and published parameters, within one gray level of the Fourier filter.
        """
        function = transfer(self.shape, gamma_high, gamma_low, cutoff, attenuation)
        blur = _Blur.of(function, self.shape)
        padded = self._padded(blur)
        scale, zero = mapping(
            _filtered_samples(padded, blur, self.shape),
            self.settings.black_percentile,
            self.settings.white_percentile,
        )
        image = np.empty(self.shape, np.uint8)

        def fill(top: int) -> None:
            rows = slice(top, min(top + _STRIP, self.shape[0]))
            values = _filtered_rows(padded, rows, blur, scale)
            cv2.exp(values, values)
            # subtracts, rounds and saturates in one pass
            cv2.addWeighted(values, 0.5, values, 0.5, -zero, image[rows], cv2.CV_8U)

        for _ in (executor.map if executor else map)(fill, range(0, self.shape[0], _STRIP)):
            pass
        return image

    def _padded(self, blur: _Blur) -> np.ndarray:
        """Return z, extended periodically by the reach of the taps."""
        height, width = self.shape
        top, left = _MARGIN - blur.above, _MARGIN - blur.beside
        if min(top, left) < 0:
            inside = self._margined[_MARGIN : _MARGIN + height, _MARGIN : _MARGIN + width]
            reach = blur.above, blur.above, blur.beside, blur.beside
            return cv2.copyMakeBorder(inside, *reach, cv2.BORDER_WRAP)
        bottom, right = height + 2 * _MARGIN - top, width + 2 * _MARGIN - left
        return self._margined[top:bottom, left:right]


@dataclass(frozen=True, slots=True)
class _Blur:
    """A filter as gains and taps: s = high z - difference (column * row * z)."""

    high: float
    difference: float
    column: np.ndarray
    row: np.ndarray

    @classmethod
    def of(cls, function: Transfer, shape: tuple[int, int]) -> _Blur:
        taps = (blur_taps(length, function.attenuation, function.cutoff) for length in shape)
        column, row = (values.astype(np.float32) for values in taps)
        return cls(function.gamma_high, function.gamma_high - function.gamma_low, column, row)

    @property
    def above(self) -> int:
        """Reach of the taps up and down, rows."""
        return len(self.column) // 2

    @property
    def beside(self) -> int:
        """Reach of the taps to either side, columns."""
        return len(self.row) // 2


def _filtered_rows(padded: np.ndarray, rows: slice, blur: _Blur, shift: float) -> np.ndarray:
    """Return s + shift of `rows` of the image."""
    around = padded[rows.start : rows.stop + 2 * blur.above]
    blurred = cv2.sepFilter2D(around, cv2.CV_32F, blur.row, blur.column)
    inside = (
        slice(blur.above, len(around) - blur.above),
        slice(blur.beside, around.shape[1] - blur.beside),
    )
    values = blurred[inside]
    cv2.addWeighted(around[inside], blur.high, values, -blur.difference, shift, values)
    return values


def _filtered_samples(padded: np.ndarray, blur: _Blur, shape: tuple[int, int]) -> np.ndarray:
    """Return s on `sample_lattice`."""
    rows, columns = sample_lattice(*shape)
    around = [padded[row : row + len(blur.column)] for row in rows]
    blurred = np.array([np.einsum('k,kx->x', blur.column, strip) for strip in around])
    blurred = cv2.sepFilter2D(blurred, cv2.CV_32F, blur.row, np.ones(1, np.float32))
    centres = np.array([strip[blur.above] for strip in around])
    inside = columns + blur.beside
    return blur.high * centres[:, inside] - blur.difference * blurred[:, inside]


def filtered(
    image: np.ndarray, used: FilterState, settings: FilterSettings | None = None
) -> np.ndarray:
    """Return the image as the filter of an identification leaves it."""
    if not used.applied:
        return image
    return HomomorphicFilter(image, settings).filtered(
        used.gamma_high, used.gamma_low, used.cutoff, used.attenuation
    )
