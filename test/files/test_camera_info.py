import re
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.files.camera_info import Calibration, calibration, undistorted, undistorted_targets

OWN = 'camera', 1936, 1296
K = np.array([[1800.0, 0, 968], [0, 1790, 648], [0, 0, 1]])
LENSES = [
    ('plumb_bob', [-0.28, 0.12, 1e-3, -5e-4, -0.02]),
    ('plumb_bob', [-0.28, 0.12, 1e-3, -5e-4]),
    ('rational_polynomial', [0.1, -0.2, 1e-3, 1e-3, 0.05, 0.2, -0.1, 0.03]),
    ('equidistant', [0.05, -0.01, 0.002, 0.0]),
]


def region(**given: int) -> SimpleNamespace:
    return SimpleNamespace(**{'x_offset': 0, 'y_offset': 0, 'width': 0, 'height': 0} | given)


def camera(**changes: Any) -> Calibration:
    message = {
        'header': SimpleNamespace(frame_id='camera'),
        'width': 1936,
        'height': 1296,
        'binning_x': 0,
        'binning_y': 0,
        'roi': region(),
        'k': K.ravel(),
        'r': [0.0] * 9,
        'p': [0.0] * 12,
        'distortion_model': 'plumb_bob',
        'd': LENSES[0][1],
    }
    return calibration(SimpleNamespace(**message | changes))


def points(count: int = 300) -> np.ndarray:
    return np.random.default_rng(3).uniform((0, 0), (1935, 1295), (count, 2))


def shown(rays: np.ndarray, model: str, distortion: list[float]) -> np.ndarray:
    """Return where a lens shows rays (x, y, 1), by OpenCV."""
    if model == 'equidistant':
        flat = np.ascontiguousarray(rays[:, None, :2])
        return cv2.fisheye.distortPoints(flat, K, np.array(distortion))[:, 0]
    return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(distortion))[0][:, 0]


@pytest.mark.parametrize(('model', 'distortion'), LENSES)
def test_the_lens_would_show_undistorted_points_where_they_were(
    model: str, distortion: list[float]
) -> None:
    tilt = cv2.Rodrigues(np.array([0.02, -0.03, 0.01]))[0]
    rectified = np.array([[1700.0, 0, 900, -180], [0, 1700, 700, 0], [0, 0, 1, 0]])
    of = {'distortion_model': model, 'd': distortion, 'r': tilt.ravel(), 'p': rectified.ravel()}
    found = undistorted(camera(**of), points())
    rays = np.column_stack((found, np.ones(len(found)))) @ np.linalg.inv(rectified[:, :3]).T @ tilt
    assert np.abs(shown(rays / rays[:, 2:], model, distortion) - points()).max() < 1e-6


def test_an_undistorted_image_stays_as_it_is() -> None:
    for without in ({'d': []}, {'d': [0.0] * 5, 'distortion_model': 'of the maker'}):
        assert np.abs(undistorted(camera(**without), points()) - points()).max() < 1e-9


def test_a_region_and_binned_pixels_are_parts_of_the_sensor() -> None:
    binned = camera(roi=region(x_offset=200, y_offset=100, width=800, height=600), binning_x=2,
                    binning_y=3)  # fmt: skip
    assert binned.size == (400, 200)
    # The first pixel shows columns 200 and 201, rows 100 to 102 of the sensor.
    whole = undistorted(camera(), np.array([[200.5, 101.0]]))
    part = undistorted(binned, np.array([[0.0, 0.0]]))
    assert part[0] * (2, 3) + (200.5, 101) == pytest.approx(whole[0], abs=1e-9)


def test_what_a_lens_cannot_show_has_no_place() -> None:
    folded = camera(d=[-0.6, 0.0, 0.0, 0.0])
    found = undistorted(folded, np.array([[968.0, 648.0], [968.0 + 1800 * 0.48, 648.0],
                                          [968.0 + 1800 * 0.52, 648.0]]))  # fmt: skip
    # x (1 - 0.6 x^2) is at most 0.497, where x is 0.745.
    assert np.isfinite(found[:2]).all()
    assert np.isnan(found[2]).all()
    target = Target(id=1, code=3, x=1930, y=648, semi_major=8, semi_minor=7)
    assert np.isnan(undistorted_targets(folded, [target])[0].x)
    assert undistorted_targets(folded, []) == ()


def test_covariances_and_ellipses_follow() -> None:
    target = Target(
        id=5, code=9, x=1800, y=1200, semi_major=12, semi_minor=9, angle=0.6, confidence=0.8,
        covariance=(4e-4, 1e-4, 1e-4, 2e-4), family='aicon12',
    )  # fmt: skip
    (moved,) = undistorted_targets(camera(), [target])
    turn = np.linspace(0, 2 * np.pi, 60)
    axes = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]]) * (12, 9)
    outline = (target.x, target.y) + np.stack((np.cos(turn), np.sin(turn)), axis=1) @ axes.T
    offsets = undistorted(camera(), outline) - (moved.x, moved.y)
    along = offsets @ (np.cos(moved.angle), np.sin(moved.angle))
    across = offsets @ (-np.sin(moved.angle), np.cos(moved.angle))
    assert (along / moved.semi_major) ** 2 + (across / moved.semi_minor) ** 2 == pytest.approx(
        np.ones(60), abs=0.01
    )
    noise = np.random.default_rng(0).multivariate_normal(
        (target.x, target.y), np.reshape(target.covariance, (2, 2)), 4000
    )
    sampled = np.cov(undistorted(camera(), noise).T)
    assert np.reshape(moved.covariance, (2, 2)) == pytest.approx(sampled, abs=4e-5)
    assert (moved.id, moved.code, moved.confidence, moved.family) == (5, 9, 0.8, 'aicon12')


@pytest.mark.parametrize(
    ('changes', 'image', 'words'),
    [
        ({'k': [0.0] * 9}, OWN, 'k of camera_info has the focal lengths 0 and 0, accepted are'),
        ({'distortion_model': 'brown'}, OWN, "distortion_model is 'brown', accepted is one of pl"),
        ({'d': [0.1, 0.2]}, OWN, 'd of camera_info is [0.1, 0.2], accepted are 0 or 4 or 5'),
        ({'d': [np.nan] * 5}, OWN, 'd of camera_info is [nan, nan'),
        ({}, ('other', 1936, 1296), "frame_id of camera_info is 'camera', accepted is that of"),
        ({}, ('camera', 968, 1296), 'camera_info is of an image of 1936 x 1296 px, accepted is'),
    ],
)
def test_what_is_no_calibration_of_an_image_is_named(
    changes: dict[str, Any], image: tuple[str, int, int], words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        camera(**changes).check(*image)


def test_a_binned_image_may_be_smaller_by_less_than_a_pixel() -> None:
    camera(binning_x=5, binning_y=5).check('camera', 387, 259)
