"""Lines through the sides of squares, their corners and centres."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.detectors.square.sides import Sides, centres, fit_sides

CORNERS = np.array([[60.3, 50.7], [160.9, 58.2], [152.4, 161.6], [55.1, 149.3]])
CELLS = 6
NEAR = np.array([[1.2, -0.7], [-1.1, 0.9], [0.6, 1.3], [-0.8, -1.0]])
"""What corners are off by before they are fitted, px."""


def drawn(
    light: np.ndarray | float = 200.0, hollow: bool = False, grown: float = 0.0
) -> np.ndarray:
    """Return gray values, shape (210, 220), of a dark quadrilateral, as a camera would blur it.

    A hollow one is white but for a border of a cell. Ink may have grown, by a length in px.
    """
    width, height, scale = 220, 210, 8
    x = (np.arange(width * scale) + 0.5) / scale - 0.5
    y = (np.arange(height * scale)[:, None] + 0.5) / scale - 0.5
    inside = np.ones((len(y), len(x)), bool)
    for (x0, y0), (x1, y1) in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y - y0) > (y1 - y0) * (x - x0)
    if hollow:
        plane = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        view = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), plane)
        columns, rows, depth = (row[0] * x + row[1] * y + row[2] for row in view)
        edge = 0.5 - 1 / CELLS
        inside &= np.maximum(np.abs(columns / depth - 0.5), np.abs(rows / depth - 0.5)) > edge
    spread = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, [2 * round(abs(grown) * scale) + 1] * 2)
    ink = (cv2.dilate if grown > 0 else cv2.erode)(inside.astype(np.uint8), spread)
    fine = np.where(ink > 0, np.float32(0.25), np.float32(1))
    shown = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)
    shown = cv2.GaussianBlur(shown, (0, 0), 0.7)
    return (shown * light).astype(np.float32)


def fitted_to(gray: np.ndarray) -> Sides:
    return fit_sides(gray, (CORNERS + NEAR)[None], CELLS, 1)


def centre_error(fitted: Sides) -> float:
    return np.abs(centres(fitted.corners) - centres(CORNERS[None])).max()


def test_corners_and_centre_of_a_quadrilateral():
    fitted = fitted_to(drawn())
    assert np.abs(fitted.corners[0] - CORNERS).max() < 0.03
    assert centre_error(fitted) < 0.01
    assert np.isnan(fitted.edge_shift[0])  # no cell beside the border is white
    assert fitted.share[0] > 0.95
    assert np.linalg.eigvalsh(fitted.covariance[0]).min() > 0


@pytest.mark.parametrize('shift', [-1.0, -0.4, 0.0, 0.5, 1.0])
def test_edges_that_moved_are_known_and_move_neither_corners_nor_centres(shift):
    fitted = fitted_to(drawn(hollow=True, grown=shift))
    assert fitted.edge_shift[0] == pytest.approx(shift, abs=0.05)
    assert np.abs(fitted.corners[0] - CORNERS).max() < 0.1
    assert centre_error(fitted) < 0.02


def test_the_centre_is_where_the_diagonals_meet():
    plane = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    view = cv2.getPerspectiveTransform(plane, CORNERS.astype(np.float32))
    physical = cv2.perspectiveTransform(np.zeros((1, 1, 2), np.float32), view)[0]
    assert centres(CORNERS[None]) == pytest.approx(physical, abs=1e-3)


def test_several_at_once_are_those_one_by_one():
    starts = np.stack([CORNERS + NEAR, CORNERS - NEAR])
    both = fit_sides(drawn(), starts, CELLS, 1)
    for start, corners in zip(starts, both.corners, strict=True):
        # BLAS may round batches of another size otherwise.
        assert fit_sides(drawn(), start[None], CELLS, 1).corners[0] == pytest.approx(
            corners, abs=1e-6
        )
    assert len(fit_sides(drawn(), np.zeros((0, 4, 2)), CELLS, 1).corners) == 0


@pytest.mark.parametrize('angle', [20, 45, 70, 110])
def test_edges_of_light_that_cross_the_sides_do_not_move_them(angle):
    rows, columns = np.indices((210, 220))
    across = columns * np.cos(np.radians(angle)) + rows * np.sin(np.radians(angle))
    light = np.where(across % 37 < 18, 200.0, 70.0)
    assert centre_error(fitted_to(drawn(light=light))) < 0.06


def test_a_slope_of_the_light_does_not_move_the_centre():
    light = 40.0 + np.indices((210, 220))[1] * 0.9
    assert centre_error(fitted_to(drawn(light=light))) < 0.015


def test_where_no_side_is_there_is_no_share():
    noise = np.random.default_rng(1).normal(120, 3, (210, 220)).astype(np.float32)
    fitted = fit_sides(noise, CORNERS[None], CELLS, 1)
    assert fitted.share[0] < 0.3
    outside = fit_sides(drawn(), CORNERS[None] + 500, CELLS, 1)
    assert outside.share[0] == 0
    assert np.isfinite(outside.corners).all()
