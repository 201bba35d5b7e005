"""Square markers, which the oldest OpenCV does not have."""

import cv2
import pytest

needs_square_markers = pytest.mark.skipif(
    not hasattr(getattr(cv2, 'aruco', None), 'ArucoDetector'),
    reason=f'OpenCV {cv2.__version__} has no square markers',
)
