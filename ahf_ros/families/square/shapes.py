"""Shapes of dark frames: squares seen by a camera, or what else is dark about something bright.

Letters, windows and lamps may have the cells of markers with few corners, such as 0 and 8 those of
ID 1023 and 975 of aruco_original. Their shapes differ: corners are round, and sides converge
although they are small.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.vision.frame import local_affine

_CORNER_ERROR = 1.0  # of the lengths of opposite sides, as corners are known to half a pixel, px
_FOCAL_LENGTH = 1.0  # about that of a camera, in image widths
_CONVERGING = 6.0  # the most that sides tell, as lenses and paper bend them, logarithmic odds


def parallel_odds(frames: np.ndarray, width: int) -> np.ndarray:
    """Return what converging sides tell of squares, shape (k,), logarithmic odds of at most 0.

    Sides of a square converge by its size over its distance, which is that of its image over the
    focal length; the image is so wide, px.
    """
    largest, smallest = np.linalg.svd(local_affine(frames), compute_uv=False).T
    usual = _CORNER_ERROR / smallest + largest / (_FOCAL_LENGTH * width)
    relative = np.linalg.norm(frames[:, 2, :2], axis=1) / usual
    return -np.minimum(relative**2 / 2, _CONVERGING)
