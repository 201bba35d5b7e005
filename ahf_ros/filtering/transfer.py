"""Transfer function of the homomorphic filter, in the spectrum and as kernels in space."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

TOLERANCE = 1e-3
"""Weight of a kernel, of 1, that may lie beyond its last tap: filtered images then stay within one
gray level of the Fourier filter."""


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


@dataclass(frozen=True, slots=True)
class Transfer:
    """Parameters of one filter.

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


def transfer(
    shape: tuple[int, int],
    gamma_high: float,
    gamma_low: float,
    cutoff: float | None = None,
    attenuation: float | None = None,
) -> Transfer:
    """Return a filter; parameters that are not given have their published values.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    gamma_high, gamma_low : float
        Gains of the high and the low frequencies, 0 <= gamma_low <= gamma_high, gamma_high > 0.
    cutoff : float, optional
        D0, cycles per image, > 0; by default the median of D.
    attenuation : float, optional
        c, >= 0; by default gamma_high - gamma_low (Eq. 8).

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
        attenuation = gamma_high - gamma_low
    else:
        _check_number('attenuation', attenuation, attenuation >= 0, 'of at least 0')
    return Transfer(float(gamma_high), float(gamma_low), float(cutoff), float(attenuation))


def blur_kernel(length: int, attenuation: float, cutoff: float) -> np.ndarray:
    """Return the circular 1-D kernel whose DFT is exp(-c (u / D0)^2).

    The Gaussian of Eq. (4) in [1]_ separates into one factor an axis, so the two-dimensional
    Fourier filter is exactly two one-dimensional circular convolutions.

    Parameters
    ----------
    length : int
        Number of samples along the axis, px.
    attenuation : float
        c of Eq. (4), dimensionless, >= 0.
    cutoff : float
        D0 of Eq. (4), cycles per image, > 0.

    Returns
    -------
    ndarray of float64, shape (length,)
        Sums to one; sample 0 is the centre.

    Raises
    ------
    ValueError
        If `cutoff` is not positive or `attenuation` is negative.

    References
    ----------
    .. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
    """
    if not cutoff > 0:
        raise ValueError(f'cutoff is {cutoff!r}, accepted is a number above 0')
    if not attenuation >= 0:
        raise ValueError(f'attenuation is {attenuation!r}, accepted is a number of at least 0')
    return np.fft.ifft(np.exp(-attenuation * (_frequencies(length) / cutoff) ** 2)).real


def blur_taps(
    length: int, attenuation: float, cutoff: float, tolerance: float = TOLERANCE
) -> np.ndarray:
    """Return `blur_kernel` truncated for a convolution in space.

    The spectrum ends at the Nyquist frequency, where it is not yet zero, so the kernel has an
    endless tail (-1)^k / k^2. The weight beyond the last tap is added to the last tap: constants
    pass exactly, and slow changes better than with a kernel twice as long.

    Parameters
    ----------
    length, attenuation, cutoff
        As for `blur_kernel`.
    tolerance : float
        Weight that may lie beyond the last tap before it is added there. With 0 the kernel is
        complete, and the convolution equals the Fourier filter up to rounding.

    Returns
    -------
    ndarray of float64, shape (2 reach + 1,)
        Symmetric about the middle, sums to one; reach <= length // 2.
    """
    half = blur_kernel(length, attenuation, cutoff)[: length // 2 + 1].copy()
    if length % 2 == 0:
        half[-1] /= 2  # the sample opposite the centre belongs to both halves
    beyond = 1 - (2 * np.cumsum(half) - half[0])
    above = np.flatnonzero(np.abs(beyond[:-1]) > tolerance)
    reach = int(above[-1]) + 1 if above.size else 0
    taps = half[: reach + 1]
    taps[reach] += beyond[reach] / (2 if reach else 1)
    return np.concatenate([taps[:0:-1], taps])


def _frequencies(length: int) -> np.ndarray:
    return np.fft.ifftshift(np.arange(length) - length // 2).astype(np.float64)


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


def _check_number(name: str, value: float, accepted: bool, range_: str) -> None:
    if not (accepted and math.isfinite(value)):
        raise ValueError(f'{name} is {value!r}, accepted is a number {range_}')
