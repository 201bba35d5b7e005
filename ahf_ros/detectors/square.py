"""Identification of square markers, ArUco and AprilTag, by OpenCV's own detector."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from ahf_ros.codes.square import dictionary
from ahf_ros.detectors.detector import DetectorSettings
from ahf_ros.image import as_gray, check_image
from ahf_ros.target import Target

_CORNER_DEVIATION = 0.04  # px, standard deviation of corners in even light, on renders
_WINDOW = 5  # px to either side of a corner, for its refinement


@dataclass(frozen=True, slots=True)
class SquareDetector:
    """Identify the markers of one dictionary.

    A target's centre is where the diagonals of its marker meet, which is the image of its physical
    centre at any view. Its ellipse is the one inscribed in the marker, its code the ID.

    Attributes
    ----------
    name : str
        'aruco' or 'apriltag'.
    settings : DetectorSettings

    Raises
    ------
    ValueError
        If OpenCV does not have the dictionary.
    """

    name: str
    settings: DetectorSettings = field(default_factory=DetectorSettings)

    def __post_init__(self) -> None:
        """Refuse a dictionary that is not there."""
        dictionary(self.family)

    @property
    def family(self) -> str:
        """Name of the dictionary as a family of targets."""
        return f'{self.name}_{getattr(self.settings.square, f"{self.name}_dictionary")}'

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the markers of one image; see `Detector`."""
        return _identified(image, self.family)


def _identified(image: np.ndarray, name: str) -> list[Target]:
    check_image(image)
    gray = np.ascontiguousarray(as_gray(image).astype(np.uint8, copy=False))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = _WINDOW
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary(name), parameters).detectMarkers(gray)
    numbers = np.zeros(0, int) if numbers is None else numbers.ravel()
    found = zip(numbers.tolist(), corners, strict=True)
    targets = [_target(number, of_marker.reshape(4, 2)) for number, of_marker in found]
    return sorted(targets, key=lambda target: (target.id, target.y, target.x))


def _target(number: int, corners: np.ndarray) -> Target:
    """Return the target with corners, shape (4, 2), in their order round it."""
    first, second, third, fourth = corners.astype(np.float64)
    ways = np.stack([third - first, second - fourth], axis=1)
    along, _ = np.linalg.solve(ways, second - first)
    x, y = first + along * (third - first)
    across = (second + third - first - fourth) / 4
    down = (third + fourth - first - second) / 4
    vectors, axes, _ = np.linalg.svd(np.stack([across, down], axis=1))
    angle = np.arctan2(vectors[1, 0], vectors[0, 0])
    # Each diagonal has two corners, and fixes the centre across itself.
    variance = _CORNER_DEVIATION**2 / 2
    return Target(
        number,
        number,
        float(x),
        float(y),
        float(axes[0]),
        float(axes[1]),
        float(np.arctan(np.tan(angle))),
        covariance=(variance, 0.0, 0.0, variance),
    )
