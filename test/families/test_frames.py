"""Frames of square markers."""

import cv2
import numpy as np
import pytest

from ahf_ros.families.square.frames import SQUARE, centres, square_frames
from ahf_ros.vision.frame import changed, outline_basis, project

CORNERS = np.array([[60.3, 50.7], [160.9, 58.2], [152.4, 161.6], [55.1, 149.3]])


def test_the_centre_is_where_the_diagonals_meet() -> None:
    view = cv2.getPerspectiveTransform(SQUARE.astype(np.float32), CORNERS.astype(np.float32))
    physical = cv2.perspectiveTransform(np.zeros((1, 1, 2), np.float32), view)[0]
    assert centres(CORNERS[None]) == pytest.approx(physical, abs=1e-3)


def test_small_changes_move_the_square_before_it_is_projected() -> None:
    frame, change = square_frames(CORNERS[None]), 1e-4 * np.array([3, 1, -4, 1, 5, -9, 2, -6.0])
    x, y = SQUARE.T
    c, f, a, b, d, e, g, h = change
    moved = np.stack([a * x + b * y + c, d * x + e * y + f], axis=1)
    moved -= (g * x + h * y)[:, None] * SQUARE
    there = project(changed(frame, change[None]), SQUARE)
    assert there == pytest.approx(project(frame, SQUARE + moved), abs=1e-3)


def test_the_basis_says_how_changes_move_an_outline() -> None:
    angles = np.linspace(0, 6, 7)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.stack([np.sin(3 * angles), np.cos(2 * angles)], axis=1)
    for number, column in enumerate(outline_basis(points, normals).T):
        there = project(changed(np.eye(3)[None], 1e-6 * np.eye(8)[[number]]), points)[0]
        assert 1e-6 * column == pytest.approx(((there - points) * normals).sum(axis=1), abs=1e-11)
