"""The camera's geometry and its sensor."""

import math

import numpy as np
import pytest

from ahf_ros.scenes.camera import Camera, Sensor, tilted_camera

PIXELS = np.array([[0.0, 0.0], [319.5, 239.5], [639.0, 479.0], [12.25, 400.5]])


def camera(tilt: float = 0.0, distortion: float = 0.0, seed: int = 0) -> Camera:
    generator = np.random.default_rng(seed)
    return tilted_camera(640, 480, 1000.0, math.radians(tilt), distortion, generator)


@pytest.mark.parametrize('distortion', [0.0, -0.25, 0.3])
@pytest.mark.parametrize('tilt', [0.0, 65.0])
def test_wall_and_pixels_map_to_and_fro(tilt: float, distortion: float) -> None:
    looking = camera(tilt, distortion)
    assert np.abs(looking.project(looking.wall(PIXELS)) - PIXELS).max() < 1e-9


def test_distortion_is_that_of_brown() -> None:
    looking = camera(distortion=-0.2)
    point = np.array([[300.0, -150.0]])
    ray = point / 1000
    seen = ray * (1 - 0.2 * (ray**2).sum()) * 1000 + looking.intrinsics[:2, 2]
    assert np.allclose(looking.project(point), seen, atol=1e-12)


def test_the_wall_is_not_mirrored() -> None:
    seen = camera(tilt=50.0).project(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert np.linalg.det(seen[1:] - seen[0]) > 0


def test_without_tilt_a_unit_of_the_wall_is_a_pixel() -> None:
    looking = camera()
    assert np.allclose(looking.jacobian(np.array([20.0, -30.0])), np.eye(2))
    assert looking.circle(np.array([20.0, -30.0]), 7.0)[:2] == pytest.approx((7.0, 7.0))


@pytest.mark.parametrize('distortion', [0.0, -0.25])
def test_the_jacobian_is_the_derivative(distortion: float) -> None:
    looking = camera(40.0, distortion)
    point = np.array([110.0, -60.0])
    steps = np.vstack((np.eye(2), -np.eye(2))) * 1e-3
    moved = looking.project(point + steps)
    assert np.allclose(looking.jacobian(point), (moved[:2] - moved[2:]).T / 2e-3, atol=1e-7)


def test_the_image_of_a_circle_lies_on_its_ellipse() -> None:
    looking = camera(60.0, seed=4)
    centre, radius = np.array([80.0, 40.0]), 25.0
    angles = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    seen = looking.project(centre + radius * np.stack((np.cos(angles), np.sin(angles)), axis=1))
    semi_major, semi_minor, angle = looking.circle(centre, radius)
    middle = np.linalg.lstsq(
        np.column_stack((seen**2, seen[:, 0] * seen[:, 1], seen)), np.ones(400), rcond=None
    )[0]
    form = np.array([[middle[0], middle[2] / 2], [middle[2] / 2, middle[1]]])
    offset = seen - np.linalg.solve(form, -middle[3:] / 2)
    along = offset @ (math.cos(angle), math.sin(angle))
    across = offset @ (-math.sin(angle), math.cos(angle))
    assert np.abs(np.hypot(along / semi_major, across / semi_minor) - 1).max() < 1e-7
    assert semi_minor < 0.6 * semi_major


def test_the_view_angle_on_the_axis_is_the_tilt() -> None:
    angles = camera(38.0).view_angle(np.array([[0.0, 0.0], [400.0, 0.0]]))
    assert math.degrees(angles[0]) == pytest.approx(38.0)
    assert angles[1] != pytest.approx(angles[0], abs=1e-3)


def test_seeds_turn_the_tilt_and_move_the_principal_point() -> None:
    first, second = camera(30.0, seed=1), camera(30.0, seed=2)
    assert not np.allclose(first.pose, second.pose)
    assert not np.allclose(first.intrinsics, second.intrinsics)
    assert np.abs(first.intrinsics[:2, 2] - (319.5, 239.5)).max() <= 6.4


def test_grey_values_follow_the_gamma() -> None:
    light = np.array([[0.0, 0.18, 0.5, 1.0, 1.5, -0.1]], np.float32)
    grey = Sensor(0.0, 0.0, 2.2).grey_values(light, np.random.default_rng(0))
    assert grey.dtype == np.uint8
    assert grey.tolist() == [[0, round(255 * 0.18 ** (1 / 2.2)), 186, 255, 255, 0]]


def test_noise_has_the_variance_of_photons_and_readout() -> None:
    light = np.full((400, 400), 0.5, np.float32)
    grey = Sensor(100.0, 3.0, 1.0).grey_values(light, np.random.default_rng(0))
    assert grey.mean() == pytest.approx(127.5, abs=0.3)
    assert grey.std() == pytest.approx(255 * math.sqrt(0.005 + 0.0009), rel=0.02)
