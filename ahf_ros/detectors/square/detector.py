"""Identification of square markers, ArUco and AprilTag, by OpenCV's detector.

Corners and centres are measured by `ahf_ros.detectors.square.sides` in the image as received.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isnan, log2
from typing import Any

import cv2
import numpy as np

from ahf_ros.codes.square import dictionary
from ahf_ros.detectors.contract import FamilyDetector, moved_targets
from ahf_ros.detectors.square.sides import centres, fit_sides
from ahf_ros.features.frame import reduced
from ahf_ros.features.pyramid import halved
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import SquareMarker, Target, sorted_targets

_DRAFT_DEVIATION = 0.3  # standard deviation of a centre from corners of contours, px
_MINIMUM_SHARE = 0.3  # of the edges on each side, for a fit to be accepted
_BORDER = 2  # cells of a marker that are its border
_CELL = 2.5  # smallest cell of a marker that is looked for, px
_LARGE = 120.0  # side of a marker whose contour gives its corners to about two pixels, px


@dataclass(frozen=True, slots=True)
class SquareDetector(FamilyDetector):
    """Identify the markers of one family."""

    @property
    def design(self) -> cv2.aruco.Dictionary:
        """Markers of the family."""
        return dictionary(self.family)

    @property
    def name(self) -> str:
        """Name in the registry, aruco or apriltag."""
        return self.family.partition('_')[0]

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the markers of one image; see `Detector`."""
        return self.refine(image, self.draft(image))

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the markers of one image, with the corners of contours, to about a pixel."""
        check_image(image)
        gray = np.ascontiguousarray(as_gray(image).astype(np.uint8, copy=False))
        parameters = cv2.aruco.DetectorParameters()
        smallest = 4 * _CELL * (self.design.markerSize + _BORDER) / max(gray.shape)
        parameters.minMarkerPerimeterRate = min(parameters.minMarkerPerimeterRate, smallest)
        detector = cv2.aruco.ArucoDetector(self.design, parameters)
        corners, numbers, _ = detector.detectMarkers(gray)
        if not corners:
            return []
        covariances = np.tile(_DRAFT_DEVIATION**2 * np.eye(2), (len(numbers), 1, 1))
        places = _places(
            np.reshape(corners, (-1, 4, 2)), covariances, np.full(len(numbers), np.nan)
        )
        return sorted_targets(
            SquareMarker(id=number, code=number, family=self.family, **place)
            for number, place in zip(numbers.ravel().tolist(), places, strict=True)
        )

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return markers with corners and centres fitted to their sides; see `Refiner`.

        Corners are known to about two pixels. Markers without sides in this image, and targets
        that are no `SquareMarker`, stay unchanged.
        """
        check_image(image)
        markers = [it for it in targets if isinstance(it, SquareMarker)]
        if not markers:
            return list(targets)
        gray = as_gray(image).astype(np.float32, copy=False)
        cells = self.design.markerSize + _BORDER
        corners = _from_halves(gray, np.array([it.corners for it in markers]), cells)
        sides = fit_sides(gray, corners, cells)
        places = _places(sides.corners, sides.covariance, sides.edge_shift)
        return moved_targets(targets, markers, places, sides.share >= _MINIMUM_SHARE)


def _from_halves(gray: np.ndarray, corners: np.ndarray, cells: int) -> np.ndarray:
    """Return the corners, shape (k, 4, 2), of large markers as halves of the image show them.

    The contour of a large marker gives its corners to a part of its side, not to two pixels.
    """
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    levels = max(0, ceil(log2(sides.max() / _LARGE)))
    corners = corners.astype(np.float64)
    halves = halved(gray, levels)
    for level in range(levels, 0, -1):
        which = np.flatnonzero(sides > _LARGE * 2 ** (level - 1))
        fit = fit_sides(halves[level], reduced(corners[which], level), cells)
        good = fit.share >= _MINIMUM_SHARE
        corners[which[good]] = (fit.corners[good] + 0.5) * 2**level - 0.5
    return corners


def _places(
    corners: np.ndarray, covariances: np.ndarray, shifts: np.ndarray
) -> list[dict[str, Any]]:
    """Return the fields of markers that say where they are, from corners, shape (k, 4, 2)."""
    corners = corners.astype(np.float64)
    first, second, third, fourth = np.moveaxis(corners, 1, 0)
    across = (second + third - first - fourth) / 4
    down = (third + fourth - first - second) / 4
    vectors, axes, _ = np.linalg.svd(np.stack([across, down], axis=2))
    angles = np.arctan(np.tan(np.arctan2(vectors[:, 1, 0], vectors[:, 0, 0])))
    columns = (centres(corners), axes, angles, covariances.reshape(-1, 4), corners, shifts)
    return [
        {
            'x': x,
            'y': y,
            'semi_major': major,
            'semi_minor': minor,
            'angle': angle,
            'covariance': tuple(covariance),
            'edge_shift': None if isnan(shift) else shift,
            'corners': tuple(map(tuple, of_marker)),
        }
        for (x, y), (major, minor), angle, covariance, of_marker, shift in zip(
            *(column.tolist() for column in columns), strict=True
        )
    ]
