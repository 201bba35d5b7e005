"""A detector for dark blobs, as another package would add it to ahf_ros."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np
from ahf_ros import DetectorSettings, Target


@dataclass(frozen=True)
class MyDetector:
    """Number dark blobs from left to right."""

    settings: DetectorSettings
    name: ClassVar[str] = 'mine'
    family: ClassVar[str] = 'blobs'

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the blobs of an 8-bit image; called from several threads at once."""
        _, dark = cv2.threshold(image, 0, 255, cv2.THRESH_OTSU + cv2.THRESH_BINARY_INV)
        _, _, sizes, centres = cv2.connectedComponentsWithStats(dark)
        radii = np.sqrt(sizes[1:, cv2.CC_STAT_AREA] / np.pi)
        found = sorted(zip(centres[1:].tolist(), radii.tolist(), strict=True))
        large = [item for item in found if item[1] >= self.settings.radii[0]]
        return [
            Target(number, number, x, y, radius, radius)
            for number, ((x, y), radius) in enumerate(large, start=1)
        ]
