"""Square markers read by this package, by OpenCV and by AprilTag's own detector."""

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.families import create_detector
from ahf_ros.families.square.frames import centres
from ahf_ros.prints.square import dictionary

FAMILY = 'apriltag_36h11'

Reader = Callable[[np.ndarray], list[Target]]


def readers() -> dict[str, Reader]:
    """Return functions that find markers in images of uint8."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    opencv = cv2.aruco.ArucoDetector(dictionary(FAMILY), parameters)

    def by_opencv(image: np.ndarray) -> list[Target]:
        corners, numbers, _ = opencv.detectMarkers(image)
        return _targets([] if numbers is None else numbers.ravel().tolist(), corners)

    found: dict[str, Reader] = {'ahf': create_detector(family=FAMILY), 'opencv': by_opencv}
    try:
        pupil = april_tag_detector()
    except ImportError:
        return found

    def by_pupil(image: np.ndarray) -> list[Target]:
        tags = pupil.detect(image)
        # There, (0, 0) is the corner of the first pixel.
        return _targets([tag.tag_id for tag in tags], [tag.corners - 0.5 for tag in tags])

    return found | {'pupil-apriltags': by_pupil}


def april_tag_detector() -> Any:
    """Return the detector of the AprilTag library; ImportError where it is not installed."""
    from pupil_apriltags import Detector

    class Kept(Detector):  # type: ignore[misc]
        """Never released, as that reads what it has freed (pupil-labs/apriltags, pull 65)."""

        def __del__(self) -> None:
            pass

    return Kept(families='tag36h11', quad_decimate=1.0)


def _targets(numbers: Sequence[int], corners: Sequence[np.ndarray]) -> list[Target]:
    middles = centres(np.reshape(corners, (-1, 4, 2)).astype(np.float64))
    return [
        Target(int(of), int(of), float(x), float(y), 1.0, 1.0)
        for of, (x, y) in zip(numbers, middles, strict=True)
    ]
