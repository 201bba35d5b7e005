"""The homomorphic filter as published: Eq. (1) to (7) of [1]_ by Fourier transforms.

It is the reference of `ahf_ros.identification.filtering.homomorphic`, about 30 times slower.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

import numpy as np

from ahf_ros.identification.filtering.homomorphic import Transfer, transfer
from ahf_ros.identification.filtering.settings import FilterSettings
from ahf_ros.vision.logarithm import logarithm, mapping, sample_lattice


def distances(height: int, width: int) -> np.ndarray:
    """Return D(u, v) of Eq. (5), shape (height, width), in cycles per image.

    The order is that of `numpy.fft.fft2`. The minus sign under the root of Eq. (5) is a misprint.
    With the origin shifted to pixel (height // 2, width // 2), D is the distance from that pixel.
    """
    rows, columns = (
        np.fft.ifftshift(np.arange(length) - length // 2) for length in (height, width)
    )
    return np.hypot(rows[:, None], columns)


def response(shape: tuple[int, int], function: Transfer) -> np.ndarray:
    """Return H(u, v) of Eq. (4) in the order of `numpy.fft.fft2`."""
    attenuated = np.exp(-function.attenuation * (distances(*shape) / function.cutoff) ** 2)
    return (function.gamma_high - function.gamma_low) * (1 - attenuated) + function.gamma_low


def filtered_logarithm_fft(
    image: np.ndarray, *parameters: float, settings: FilterSettings | None = None
) -> np.ndarray:
    """Return s of Eq. (6), float64; parameters are those of `transfer`."""
    values = logarithm(image, (settings or FilterSettings()).log_offset).astype(np.float64)
    function = transfer(image.shape, *parameters)
    return np.fft.ifft2(response(image.shape, function) * np.fft.fft2(values)).real


def sampled(values: np.ndarray) -> np.ndarray:
    """Return `values`, shape (height, width), where the output mapping samples them."""
    return values[np.ix_(*sample_lattice(*values.shape))]


def filtered_fft(
    image: np.ndarray, *parameters: float, settings: FilterSettings | None = None
) -> np.ndarray:
    """Return what `HomomorphicFilter.filtered` approximates, uint8."""
    settings = settings or FilterSettings()
    values = filtered_logarithm_fft(image, *parameters, settings=settings)
    scale, zero = mapping(sampled(values), settings.black_percentile, settings.white_percentile)
    return np.clip(np.rint(np.exp(values + scale) - zero), 0, 255).astype(np.uint8)
