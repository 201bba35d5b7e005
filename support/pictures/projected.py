"""Photographs as if a projector had lit what they show.

A pattern of light is multiplied with the light of a photograph, so that paper, ink, lens and the
processing of the camera are real, and the targets are known. Noise is that of photons and of
reading, and the result is a JPEG as cameras write it. A pattern in periods is as large beside the
dots as in rendered scenes; shadows and spots of light are as large as the picture.
"""

import cv2
import numpy as np

from ahf_ros.scenes.patterns import light_pattern

_GAMMA = 2.2  # from light to gray values of photographs, about
_PER_RADIUS = 6.6  # px of a projector for the radius of a dot, as in scenes of 54 targets
_VIEW = 1280, 800  # px of a projector
_WHOLE = 'spots', 'shadow'  # patterns that are as large as the view
_DEFOCUS = 1.0  # px of a projector
_TILT = 0.03  # change of scale across the picture
_PHOTONS, _READING = 1e-4, 0.002  # variance of full light, and deviation beside it, shares of it
_QUALITY = 92  # of a JPEG


def lit(gray: np.ndarray, name: str, ambient: float, radius: float, seed: int) -> np.ndarray:
    """Return a photograph, uint8, under one of `LIGHT_NAMES`.

    The ambient light is a share of all light, and the radius that of most dots, px.
    """
    generator = np.random.default_rng(seed)
    height, width = gray.shape
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    across, down = columns / width - 0.5, rows / height - 0.5
    if name in _WHOLE:
        u, v = across * _VIEW[0], down * _VIEW[1]
    else:
        tilted = 1 + across * generator.uniform(-_TILT, _TILT)
        tilted += down * generator.uniform(-_TILT, _TILT)
        scale = np.float32(_PER_RADIUS / radius) / tilted
        u, v = across * width * scale, down * height * scale
    pattern = light_pattern(name, _DEFOCUS, generator)(u, v)
    light = (gray / np.float32(255)) ** _GAMMA * (ambient + (1 - ambient) * pattern)
    noise = generator.standard_normal(light.shape, np.float32)
    light += noise * np.sqrt(light * _PHOTONS + _READING**2)
    shown = np.rint(np.clip(light, 0, 1) ** (1 / _GAMMA) * 255).astype(np.uint8)
    file = cv2.imencode('.jpg', shown, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    return np.asarray(cv2.imdecode(file, cv2.IMREAD_GRAYSCALE))
