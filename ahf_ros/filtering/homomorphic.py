"""Homomorphic filtering of one image with many filters.

The filter of [1]_ (Eq. 1 to 7) is z = ln f, S = H F(z), g = exp s with a Gaussian H:

    H = gamma_high - d exp(-c (D / D0)^2),  d = gamma_high - gamma_low

The Gaussian is separable, so s = gamma_high z - d (G * z), where G * is a circular convolution
along the rows and one along the columns. The logarithm is taken once per image; each filter then
passes over it once, in strips of rows that stay in the cache of a core. By default c = d and D0 is
the median of D. `support.fourier` has the published form, with which tests compare.

Two steps that the paper leaves open are defined here:

- Offset: z = ln(f / range + offset), because f may be 0. `ahf_ros.imaging.logarithm.logarithm`
  defines the range. The division scales g by a constant.
- Output mapping: g is mapped linearly to 8 bit, one percentile of g to 0 and another to 255. Both
  are taken on a lattice of rows and columns that depends on the size of the image only.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.filtering.settings import FilterSettings
from ahf_ros.filtering.transfer import Transfer, blur_taps, transfer
from ahf_ros.imaging.image import check_image
from ahf_ros.imaging.logarithm import logarithm, mapping, sample_lattice

MARGIN = 12
"""Width of the periodic border around a logarithm, px; few filters reach further."""

STRIP = 128
"""Rows that are processed at once, few enough to stay in the cache of a core."""


class HomomorphicFilter:
    """One image, prepared to be filtered many times; thread-safe.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        An image that `ahf_ros.imaging.image.check_image` accepts; no reference is kept.
    settings : FilterSettings
        Offset and output mapping.

    Raises
    ------
    ValueError
        If the image is not accepted.

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
        self._margined = _surrounded(logarithm(image, self.settings.log_offset), MARGIN, MARGIN)

    def filtered(
        self,
        gamma_high: float,
        gamma_low: float,
        cutoff: float | None = None,
        attenuation: float | None = None,
        executor: Executor | None = None,
    ) -> np.ndarray:
        """Return g of Eq. (7), mapped to 8 bit.

        Parameters
        ----------
        gamma_high, gamma_low, cutoff, attenuation
            As for `transfer`.
        executor : concurrent.futures.Executor, optional
            Threads that share the strips of the image; they do not change the result. Must not
            be the executor that runs this call, which would wait for itself.

        Returns
        -------
        ndarray of uint8, shape (height, width)
            For photographs and published parameters, within one gray level of the Fourier filter.

        Raises
        ------
        ValueError
            If a parameter is out of its range.
        """
        function = transfer(self.shape, gamma_high, gamma_low, cutoff, attenuation)
        spatial = _spatial(self.shape, function)
        padded = self._padded(spatial)
        scale, zero = mapping(
            _filtered_samples(padded, spatial, self.shape),
            self.settings.black_percentile,
            self.settings.white_percentile,
        )
        image = np.empty(self.shape, np.uint8)

        def fill(rows: slice) -> None:
            values = _filtered_rows(padded, rows, spatial, scale)
            cv2.exp(values, values)
            # subtracts, rounds and saturates in one pass
            cv2.addWeighted(values, 0.5, values, 0.5, -zero, image[rows], cv2.CV_8U)

        _in_strips(fill, self.shape[0], executor)
        return image

    def filtered_logarithm(
        self,
        gamma_high: float,
        gamma_low: float,
        cutoff: float | None = None,
        attenuation: float | None = None,
        executor: Executor | None = None,
    ) -> np.ndarray:
        """Return s of Eq. (6), float32, shape (height, width).

        With the published parameters, within 0.0015 (max z - min z) of the Fourier filter for
        photographs, and 0.008 (max z - min z) for black and white pixel noise.
        """
        function = transfer(self.shape, gamma_high, gamma_low, cutoff, attenuation)
        spatial = _spatial(self.shape, function)
        padded = self._padded(spatial)
        filtered = np.empty(self.shape, np.float32)

        def fill(rows: slice) -> None:
            filtered[rows] = _filtered_rows(padded, rows, spatial)

        _in_strips(fill, self.shape[0], executor)
        return filtered

    def _padded(self, spatial: _Spatial) -> np.ndarray:
        """Return z, extended periodically by the reach of the taps."""
        height, width = self.shape
        top, left = MARGIN - spatial.above, MARGIN - spatial.beside
        if min(top, left) < 0:
            inside = self._margined[MARGIN : MARGIN + height, MARGIN : MARGIN + width]
            return _surrounded(inside, spatial.above, spatial.beside)
        bottom, right = height + 2 * MARGIN - top, width + 2 * MARGIN - left
        return self._margined[top:bottom, left:right]


@dataclass(frozen=True, slots=True)
class _Spatial:
    """A filter as gains and taps: s = high z - difference (column * row * z)."""

    high: float
    difference: float
    column: np.ndarray
    row: np.ndarray

    @property
    def above(self) -> int:
        """Reach of the taps up and down, rows."""
        return len(self.column) // 2

    @property
    def beside(self) -> int:
        """Reach of the taps to either side, columns."""
        return len(self.row) // 2


def _spatial(shape: tuple[int, int], function: Transfer) -> _Spatial:
    taps = (blur_taps(length, function.attenuation, function.cutoff) for length in shape)
    column, row = (values.astype(np.float32) for values in taps)
    return _Spatial(function.gamma_high, function.gamma_high - function.gamma_low, column, row)


def _surrounded(values: np.ndarray, above: int, beside: int) -> np.ndarray:
    return cv2.copyMakeBorder(values, above, above, beside, beside, cv2.BORDER_WRAP)


def _in_strips(fill: Callable[[slice], None], height: int, executor: Executor | None) -> None:
    strips = [slice(top, min(top + STRIP, height)) for top in range(0, height, STRIP)]
    for _ in (executor.map if executor else map)(fill, strips):
        pass


def _filtered_rows(
    padded: np.ndarray, rows: slice, spatial: _Spatial, shift: float = 0.0
) -> np.ndarray:
    """Return s + shift of `rows` of the image."""
    around = padded[rows.start : rows.stop + 2 * spatial.above]
    blurred = cv2.sepFilter2D(around, cv2.CV_32F, spatial.row, spatial.column)
    inside = (
        slice(spatial.above, len(around) - spatial.above),
        slice(spatial.beside, around.shape[1] - spatial.beside),
    )
    values = blurred[inside]
    cv2.addWeighted(around[inside], spatial.high, values, -spatial.difference, shift, values)
    return values


def _filtered_samples(padded: np.ndarray, spatial: _Spatial, shape: tuple[int, int]) -> np.ndarray:
    """Return s on `sample_lattice`."""
    rows, columns = sample_lattice(*shape)
    around = [padded[row : row + len(spatial.column)] for row in rows]
    blurred = np.array([np.einsum('k,kx->x', spatial.column, strip) for strip in around])
    blurred = cv2.sepFilter2D(blurred, cv2.CV_32F, spatial.row, np.ones(1, np.float32))
    centres = np.array([strip[spatial.above] for strip in around])
    inside = columns + spatial.beside
    return spatial.high * centres[:, inside] - spatial.difference * blurred[:, inside]
