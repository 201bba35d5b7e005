"""Photographs as if a projector had lit what they show.

A pattern of light is multiplied with the light of a photograph, so that paper, ink, lens and the
processing of the camera are real, and the targets are known. The result has the noise of a sensor
and is a JPEG, as cameras write it. A pattern in periods is as large beside the dots as in rendered
scenes; shadows and spots of light are as large as the picture.
"""

import cv2
import numpy as np

from ahf_ros.scenes.camera import Sensor
from ahf_ros.scenes.patterns import HALF_VIEW, PROJECTOR_PIXELS, light_pattern
from support.pictures.disturbed import compressed
from support.pictures.exposure import GAMMA

_SENSOR = Sensor(10000.0, 20.0, GAMMA)
_WHOLE = 'spots', 'shadow'  # patterns that are as large as the view
_DEFOCUS = 1.0  # px of a projector
_TILT = 0.03  # change of scale across the picture
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
        u, v = (2 * half * of for half, of in zip(HALF_VIEW, (across, down), strict=True))
    else:
        tilted = 1 + across * generator.uniform(-_TILT, _TILT)
        tilted += down * generator.uniform(-_TILT, _TILT)
        scale = np.float32(PROJECTOR_PIXELS / radius) / tilted
        u, v = across * width * scale, down * height * scale
    pattern = light_pattern(name, _DEFOCUS, generator)(u, v)
    light = cv2.pow(gray / np.float32(255), GAMMA) * (ambient + (1 - ambient) * pattern)
    return compressed(_QUALITY, _SENSOR.grey_values(light, generator), generator)
