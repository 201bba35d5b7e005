"""Images that no detector is for: each is identified or left alone, without an error.

None shows a target of the detector, or one many times, so that nothing false may be reported.
"""

import warnings
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros import create_detector
from support import ROOT
from support.scenes import rendering
from support.square_markers import needs_square_markers

DETECTORS = [
    ('ring', 'metashape12'),
    ('traditional', 'metashape12'),
    ('gsi', 'gsi'),
    ('gsi_published', 'gsi'),
    ('dots', 'dots'),
    ('dots_published', 'dots'),
    ('cctag', 'cctag3'),
    pytest.param('aruco', 'aruco_4x4_50', marks=needs_square_markers),
    pytest.param('apriltag', 'apriltag_36h11', marks=needs_square_markers),
]
every_detector = pytest.mark.parametrize(('detector', 'family'), DETECTORS)

TIMES = 260  # more than a byte counts
"""Of one target in an image."""

RADII = {'gsi': 2.5, 'cctag3': 12.0}
"""Radius of dots by family, px; of the others 5."""


def saturated() -> np.ndarray:
    """Return an image that is white but for a few pixels."""
    image = np.full((120, 160), 255, np.uint8)
    image[40:44, 50:53] = 250
    image[80, 100] = 0
    return image


def moire() -> np.ndarray:
    """Return rings that become finer than pixels, as of a camera before a screen."""
    y, x = np.mgrid[-120:120, -160:160].astype(np.float64)
    return (127 + 100 * np.cos((x * x + y * y) / 60)).astype(np.uint8)


def many_dots() -> np.ndarray:
    """Return an image of 20,000 dots."""
    image = np.full((100 * 7, 200 * 7), 200, np.uint8)
    image.reshape(100, 7, 200, 7)[:, 2:5, :, 2:5] = 40
    return image


def page() -> np.ndarray:
    """Return a photograph of a page of this package's own reports."""
    shown = cv2.imread(str(ROOT / 'docs' / 'pictures' / 'report.jpg'), cv2.IMREAD_GRAYSCALE)
    height, width = shown.shape
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    seen = np.float32([[30, 10], [470, 30], [490, 340], [10, 350]])
    map_ = cv2.getPerspectiveTransform(corners, seen)
    return cv2.warpPerspective(shown, map_, (500, 360), flags=cv2.INTER_AREA, borderValue=90)


@cache
def repeated(family: str) -> np.ndarray:
    """Return an image of one target, many times."""
    radius = RADII.get(family, 5.0)
    shown = rendering(
        width=160, height=160, targets=1, family=family, dot_radius=radius, tilt=0.0, seed=2
    )
    (target,) = shown.targets
    half = round(min(target.x, target.y, 159 - target.x, 159 - target.y, 36))
    x, y = round(target.x), round(target.y)
    tile = shown.image[y - half : y + half, x - half : x + half]
    return np.tile(tile, (20, TIMES // 20))


@every_detector
@pytest.mark.parametrize('shape', [(1, 1), (1, 300), (15, 15)])
def test_an_image_without_room_for_a_target_is_refused(
    detector: str, family: str, shape: tuple[int, int]
) -> None:
    with pytest.raises(ValueError, match='accepted is at least 16 x 16 px'):
        create_detector(detector, family=family)(np.zeros(shape, np.uint8))


@every_detector
@pytest.mark.parametrize('gray', [0, 128, 255])
def test_a_constant_image_is_refused(detector: str, family: str, gray: int) -> None:
    with pytest.raises(ValueError, match='constant'):
        create_detector(detector, family=family)(np.full((64, 64), gray, np.uint8))


@every_detector
@pytest.mark.parametrize('make', [saturated, moire, many_dots, page])
def test_what_shows_no_target_is_left_alone(detector: str, family: str, make: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        found = create_detector(detector, family=family)(make())
    if make is not page:  # which shows images with targets
        assert found == []


@every_detector
def test_it_does_not_matter_how_an_image_lies_in_memory(detector: str, family: str) -> None:
    radius = RADII.get(family, 5.0)
    image = rendering(width=160, height=160, targets=1, family=family, dot_radius=radius).image
    detect = create_detector(detector, family=family)
    found = detect(image)
    assert found or detector == 'gsi_published'  # which reads larger ones
    held = image.copy()
    held.flags.writeable = False
    turned, spread = image[::-1, ::-1].copy(), np.repeat(image, 2, axis=1)
    for same in (np.asfortranarray(image), turned[::-1, ::-1], spread[:, ::2], held):
        assert detect(same) == found


@pytest.mark.lasting
@every_detector
def test_one_target_many_times_is_no_error(detector: str, family: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        found = create_detector(detector, family=family)(repeated(family))
    assert len({it.id for it in found}) <= 1
