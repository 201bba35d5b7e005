"""Blobs of a thresholded image that may be dots, by their contours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from ahf_ros.features.frame import affine_frames

_WINDOW = 80  # side of the square in which the threshold lies between the extremes, px
_MINIMUM_CONTRAST = 20  # difference of those for there to be anything, gray values of 8 bit
_REDUCTION = 4  # of the image in which the extremes are looked for
_MINIMUM_ROUNDNESS = 0.4  # 4 pi area / perimeter^2; a circle at 70 degrees has 0.67, at 78 0.45
_MAXIMUM_MISFIT = 0.12  # between the areas of a contour and of its ellipse, relative
_MINIMUM_PERIMETER = 5.0  # points of a contour, which an ellipse takes
_CHORD = 2.0  # points of a contour in a radius of the smallest dot, also at steep views
_SLACK = 2.0  # radius of a contour over the largest of a dot, px


def masks(gray: np.ndarray, polarities: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Yield 1 and the mask of the dark pixels of an image, then -1 and of the bright ones.

    The threshold is Bernsen's, halfway between the extremes of the neighbourhood.

    Parameters
    ----------
    gray : ndarray of uint8, shape (height, width)
    polarities : sequence of int
        1 for the dark pixels, -1 for the bright ones.
    """
    height, width = gray.shape
    size = (-(-width // _REDUCTION), -(-height // _REDUCTION))
    reduced = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    window = (_WINDOW // _REDUCTION,) * 2
    kernel = np.ones(window, np.uint8)
    darkest, brightest = (
        cv2.blur(extreme(reduced, kernel), window, borderType=cv2.BORDER_REPLICATE)
        for extreme in (cv2.erode, cv2.dilate)
    )
    middle = cv2.addWeighted(darkest, 0.5, brightest, 0.5, 0)
    flat = cv2.subtract(brightest, darkest) < _MINIMUM_CONTRAST
    smooth = cv2.blur(gray, (3, 3))
    for polarity in polarities:
        unreachable, comparison = (0, cv2.CMP_LT) if polarity > 0 else (255, cv2.CMP_GT)
        threshold = np.where(flat, np.uint8(unreachable), middle)
        threshold = cv2.resize(threshold, (width, height), interpolation=cv2.INTER_LINEAR)
        mask = cv2.compare(smooth, threshold, comparison)
        yield polarity, cv2.medianBlur(cv2.medianBlur(mask, 3), 3)


def blob_frames(mask: np.ndarray, min_radius: float, max_radius: float) -> np.ndarray:
    """Return the frames of the blobs with the perimeter, roundness and ellipse of a dot.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
        Not zero in blobs.
    min_radius, max_radius : float
        Of the dots, px.

    Returns
    -------
    ndarray of float64, shape (k, 3, 3)
        To about a pixel.
    """
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    shortest = max(_MINIMUM_PERIMETER, _CHORD * min_radius)
    longest = 2 * np.pi * (max_radius + _SLACK)
    ellipses = []
    for index, contour in enumerate(contours):
        if not shortest <= len(contour) <= longest or hierarchy[0, index, 3] >= 0:
            continue
        area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, closed=True)
        if 4 * np.pi * area < _MINIMUM_ROUNDNESS * perimeter**2:
            continue
        (x, y), (width, height), angle = cv2.fitEllipse(contour)
        if abs(np.pi / 4 * width * height - area) < _MAXIMUM_MISFIT * area:
            # A contour runs through the centres of a blob's outermost pixels, half a pixel inside.
            ellipses.append((x, y, (width + 1) / 2, (height + 1) / 2, np.deg2rad(angle)))
    return affine_frames(*np.reshape(ellipses, (-1, 5)).T)
