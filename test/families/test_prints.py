"""Prints of square markers laid over an image: small ones, too, and only where light is even."""

import cv2
import numpy as np

from ahf_ros.families.square.frames import SQUARE, Places, centres
from ahf_ros.families.square.prints import lay_outlines, lay_prints
from ahf_ros.prints.square import words
from support.square_markers import needs_square_markers

pytestmark = needs_square_markers
CORNERS = np.array([[0.3, 0.7], [12.1, 1.6], [11.0, 13.2], [-0.6, 12.0]]) + 14.0
"""Of a marker whose cells are a pixel and a half wide, px."""

ROUGH = np.array([[0.5, -0.6], [-0.4, 0.7], [0.6, 0.4], [-0.5, -0.7]])
"""What corners are off by before they are fitted, px."""


def ink() -> np.ndarray:
    return ~np.pad(words('apriltag_36h11')[7], 1)


def drawn(corners: np.ndarray = CORNERS, light: np.ndarray | float = 200.0) -> np.ndarray:
    """Return gray values of a marker of 8 x 8 cells on paper, as a camera would blur it."""
    scale, side = 16, 56
    cells = np.kron(np.pad(~ink(), 3, constant_values=True), np.ones((40, 40), np.float32))
    plane = (SQUARE * 8 + 7) * 40 - 0.5
    fine = (corners + 0.5) * scale - 0.5
    view = cv2.getPerspectiveTransform(plane.astype(np.float32), fine.astype(np.float32))
    size = (side * scale, side * scale)
    shown = cv2.warpPerspective(cells, view, size, flags=cv2.INTER_LINEAR, borderValue=1.0)
    shown = cv2.resize(0.2 + 0.8 * shown, (side, side), interpolation=cv2.INTER_AREA)
    return (cv2.GaussianBlur(shown, (0, 0), 0.6) * light).astype(np.float32)


def test_corners_of_a_small_marker() -> None:
    found = lay_prints(drawn(), Places.unmeasured((CORNERS + ROUGH / 2)[None]), ink()[None])
    assert np.abs(found.corners[0] - CORNERS).max() < 0.06
    assert np.abs(centres(found.corners) - centres(CORNERS[None])).max() < 0.03
    assert found.share[0] > 0.95
    assert 0.2 < found.edge_shift[0] < 0.4  # gray values that are light: as if ink had grown
    deviations = np.sqrt(np.linalg.eigvalsh(found.covariance[0]))
    assert 0 < deviations[0] <= deviations[1] < 0.05


def test_the_outline_is_found_before_the_marker_is_read() -> None:
    found = lay_outlines(drawn(), (CORNERS + ROUGH)[None])
    assert np.abs(found[0] - CORNERS).max() < 0.2


def test_what_is_no_marker_stays_as_it_is() -> None:
    noise = np.random.default_rng(1).normal(120, 30, (56, 56)).astype(np.float32)
    assert (lay_outlines(noise, CORNERS[None]) == CORNERS).all()
    for gray in (noise, np.full_like(noise, 90), 255 - drawn()):
        found = lay_prints(gray, Places.unmeasured(CORNERS[None]), ink()[None])
        assert found.share[0] == 0
        assert (found.corners[0] == CORNERS).all()


def test_sides_are_kept_where_light_is_uneven() -> None:
    rows, columns = np.indices((56, 56))
    light = np.where((rows + columns) % 11 < 5, 200.0, 70.0)
    place = CORNERS * 1.5
    sides = Places(place[None], np.ones(1), 0.01 * np.eye(2)[None], np.full(1, np.nan))
    found = lay_prints(drawn(place, light), sides, ink()[None])
    assert (found.corners == sides.corners).all()
    even = lay_prints(drawn(place), sides, ink()[None])
    assert np.trace(even.covariance[0]) < np.trace(sides.covariance[0])


def test_markers_at_the_border_of_the_image_and_none_at_all() -> None:
    found = lay_prints(drawn()[:, 14:], Places.unmeasured((CORNERS - (14, 0))[None]), ink()[None])
    assert found.share[0] == 0
    none = Places.unmeasured(np.zeros((0, 4, 2)))
    assert len(lay_prints(drawn(), none, ink()[None][:0]).corners) == 0
    assert len(lay_outlines(drawn(), np.zeros((0, 4, 2)))) == 0
