"""What others do about uneven light before an identification: rivals of AHF in benchmarks."""

from collections.abc import Callable

import cv2
import numpy as np

CLIP_LIMIT, TILES = 2.0, (8, 8)
"""Of CLAHE: limit of the contrast, and tiles of the image across and down."""

SURROUND = 80.0
"""Standard deviation of the surround of retinex, px: the middle one of Jobson et al., 1997."""

NEIGHBOURHOOD = 40.0
"""Standard deviation of the window of the local normalisation, px: two dots."""

_REDUCTION = 8  # of the image in which a wide blur is computed
_PERCENTILES = (0.1, 99.5)  # that become black and white, as in the homomorphic filter
_MINIMUM_DEVIATION = 2.0  # gray values, for the local normalisation to divide by


def contrast_limited_equalisation(image: np.ndarray) -> np.ndarray:
    """Return an 8-bit image after CLAHE."""
    return cv2.createCLAHE(CLIP_LIMIT, TILES).apply(image)


def retinex(image: np.ndarray) -> np.ndarray:
    """Return an 8-bit image after single-scale retinex, ln I - ln (G * I)."""
    light = image.astype(np.float32)
    return _stretched(np.log1p(light) - np.log1p(_blurred(light, SURROUND)))


def local_normalisation(image: np.ndarray) -> np.ndarray:
    """Return an 8-bit image less its local mean, in units of its local standard deviation."""
    light = image.astype(np.float32)
    mean = _blurred(light, NEIGHBOURHOOD)
    variance = _blurred(light * light, NEIGHBOURHOOD) - mean * mean
    return _stretched((light - mean) / np.sqrt(np.maximum(variance, _MINIMUM_DEVIATION**2)))


PREPROCESSORS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'CLAHE': contrast_limited_equalisation,
    'equalisation': cv2.equalizeHist,
    'retinex': retinex,
    'local normalisation': local_normalisation,
}
"""From 8-bit images, shape (height, width), to others of the same shape."""


def _blurred(values: np.ndarray, deviation: float) -> np.ndarray:
    """Return a wide Gaussian blur, computed in a reduced image."""
    height, width = values.shape
    reduced = (max(1, width // _REDUCTION), max(1, height // _REDUCTION))
    small = cv2.resize(values, reduced, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), deviation / _REDUCTION)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)


def _stretched(values: np.ndarray) -> np.ndarray:
    black, white = np.percentile(values, _PERCENTILES)
    shares = (values - black) / max(float(white - black), 1e-6)
    return np.rint(255 * np.clip(shares, 0, 1)).astype(np.uint8)
