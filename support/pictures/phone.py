"""What a phone makes of an image: blur, contrast, noise, denoising, sharpening, JPEG."""

import cv2
import numpy as np

from support.pictures.disturbed import blurred, compressed, noisy

BLUR = (0.4, 1.0)
"""Standard deviation of the lens, px."""

NOISE = (2.0, 9.0)
"""Standard deviation of the sensor, gray values."""

_BLACK_WHITE = (0.5, 99.5)  # percentiles of what becomes black and white
_GAMMA, _STEEPNESS, _WHITE = (0.7, 1.3), (0.5, 1.1), (128, 255)  # of the curve of contrast
_DENOISED, _RANGE = 0.6, (10.0, 40.0)  # share of images, and gray values that are smoothed away
_SHARPENED, _HALO = (0.0, 1.6), (0.7, 2.5)  # strength, and width of the halo, px
_QUALITY = (60, 95)  # of JPEG


def phone(image: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an image, uint8, as a phone's camera and its processing would give it.

    Strengths are drawn anew for each image, in the order in which they are applied.
    """
    gray = blurred(generator.uniform(*BLUR), image.astype(np.float32), generator)
    black, white = np.percentile(gray, _BLACK_WHITE)
    level = np.clip((gray - black) / max(white - black, 1), 0, 1) ** generator.uniform(*_GAMMA)
    steep = generator.uniform(*_STEEPNESS)
    level = 0.5 + 0.5 * np.tanh(2 * steep * (level - 0.5)) / np.tanh(steep)
    gray = noisy(generator.uniform(*NOISE), generator.uniform(*_WHITE) * level, generator)
    if generator.random() < _DENOISED:
        gray = cv2.bilateralFilter(gray, 5, generator.uniform(*_RANGE), 2.0)
    strength, halo = generator.uniform(*_SHARPENED), generator.uniform(*_HALO)
    soft = blurred(halo, gray.astype(np.float32), generator)
    sharpened = np.clip((1 + strength) * gray - strength * soft, 0, 255).astype(np.uint8)
    return compressed(int(generator.integers(*_QUALITY)), sharpened, generator)
