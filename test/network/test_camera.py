"""The camera against OpenCV, and its derivatives against differences."""

from typing import TypeAlias

import cv2
import numpy as np
import pytest

from ahf_ros.network import camera

CALIBRATION = np.array([2000, 1010, 690, -0.2, 0.1, -0.03, 1e-3, -2e-3, 1e-3, 5e-4])

Scene: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]
"""A rotation matrix, a position, and points."""


@pytest.fixture
def scene() -> Scene:
    random = np.random.default_rng(1)
    rotation = camera.rotation_matrices(random.normal(0, 0.3, (1, 3)))[0]
    return rotation, np.array([0.1, -0.2, -4]), random.uniform(-1, 1, (20, 3))


def test_projects_as_opencv(scene: Scene) -> None:
    rotation, position, points = scene
    calibration = CALIBRATION.copy()
    calibration[9] = 0
    f, cx, cy, k1, k2, k3, p1, p2, affinity, _ = calibration
    matrix = np.array([[f * (1 + affinity), 0, cx], [0, f, cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(
        points,
        cv2.Rodrigues(rotation)[0],
        -rotation @ position,
        matrix,
        np.array([k1, k2, p1, p2, k3]),
    )
    xy = camera.project(calibration, rotation, position, points)
    np.testing.assert_allclose(xy, expected[:, 0], atol=1e-9)


def test_undistorts_what_it_distorts(scene: Scene) -> None:
    rotation, position, points = scene
    seen = (points - position) @ rotation.T
    xy = camera.project(CALIBRATION, rotation, position, points)
    ideal = camera.undistort(CALIBRATION, xy)
    np.testing.assert_allclose(ideal, seen[:, :2] / seen[:, 2:], atol=1e-12)


def test_backward_correction_is_taken_at_the_measured_place(scene: Scene) -> None:
    rotation, position, points = scene
    measured = camera.project(CALIBRATION, rotation, position, points)
    ideal = camera.undistort(CALIBRATION, measured, backward=True)
    seen = np.column_stack([ideal, np.ones(len(ideal))]) * 3
    there = seen @ rotation + position
    again = camera.project(CALIBRATION, rotation, position, there, measured)
    np.testing.assert_allclose(again, measured, atol=1e-9)


def test_behind_the_camera_is_nan(scene: Scene) -> None:
    rotation, position, points = scene
    behind = position - (points - position)
    assert np.isnan(camera.project(CALIBRATION, rotation, position, behind)).all()


def test_fisheye_lenses_are_those_of_opencv(scene: Scene) -> None:
    rotation, position, points = scene
    wide = points * [8, 8, 1]  # up to 70 degrees off the axis
    matrix = np.array([[2002, 0, 1010], [0, 2000, 690], [0, 0, 1.0]])
    distortion = np.array([0.05, 0.01, -0.004, 0.0005])
    calibration = np.array([2000, 1010, 690, *distortion, 0, 1e-3, 0])
    turn, shift = cv2.Rodrigues(rotation)[0], -rotation @ position
    expected, _ = cv2.fisheye.projectPoints(wide[:, None], turn, shift, matrix, distortion)
    xy = camera.project(calibration, rotation, position, wide, equidistant=True)
    np.testing.assert_allclose(xy, expected[:, 0], atol=1e-8)
    seen = (wide - position) @ rotation.T
    ideal = camera.undistort(calibration, xy, equidistant=True)
    np.testing.assert_allclose(ideal, seen[:, :2] / seen[:, 2:], atol=1e-9)


@pytest.mark.parametrize(('backward', 'equidistant'), [(0, 0), (1, 0), (0, 1)])
def test_derivatives_are_differences(scene: Scene, backward: int, equidistant: int) -> None:
    rotation, position, points = scene
    measured = camera.project(CALIBRATION, rotation, position, points) + 0.5
    measured = measured if backward else None
    fisheye = (np.arange(len(points)) % 2 == 0) & bool(equidistant)  # every second one
    linear = camera.linearise(CALIBRATION, rotation, position, points, measured, fisheye)

    def image(change: np.ndarray) -> np.ndarray:
        turned = camera.rotation_matrices(change[None, 13:16])[0] @ rotation
        return camera.project(
            CALIBRATION + change[:10],
            turned,
            position + change[10:13],
            points + change[16:],
            measured,
            fisheye,
        )

    steps = np.array([1e-3] * 3 + [1e-6] * 16)
    expected = np.stack(
        [(image(step) - image(-step)) / (2 * step.sum()) for step in np.diag(steps)], axis=2
    )
    analytic = np.concatenate([linear.by_calibration, linear.by_pose, linear.by_point], axis=2)
    np.testing.assert_allclose(analytic, expected, atol=2e-5)
