"""Homographies of small flat objects."""

import numpy as np
import pytest

from ahf_ros.families.gsi.refinement import ellipse_centres
from ahf_ros.vision.frame import ellipse_axes, project
from ahf_ros.vision.homography import fit_homographies, local_frames

POINTS = np.array([[14.5, 14.5], [-0.5, -11.5], [-11.5, -11.5], [-11.5, -0.5], [0, 0], [3.5, 14]])


def homographies(count: int, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    made = np.zeros((count, 3, 3))
    made[:, :2, :2] = generator.uniform(-4, 4, (count, 2, 2)) + 5 * np.diag([1, -1])
    made[:, :2, 2] = generator.uniform(100, 900, (count, 2))
    made[:, 2, :2] = generator.uniform(-0.002, 0.002, (count, 2))
    made[:, 2, 2] = 1.0
    return made


def test_exact_images_give_the_homography_but_for_the_prior() -> None:
    true = homographies(20)
    images = project(true, POINTS)
    fit = fit_homographies(POINTS, images, np.full((20, 6), 1e6), 20.0)
    assert np.abs(project(fit.homographies, POINTS) - images).max() < 1e-3
    assert np.abs(fit.homographies[:, :2, 2] - true[:, :2, 2]).max() < 1e-3


def test_points_without_weight_do_not_count() -> None:
    true = homographies(5)
    images = project(true, POINTS)
    images[:, 3] += 40.0
    weights = np.full((5, 6), 1e6)
    weights[:, 3] = 0.0
    fit = fit_homographies(POINTS, images, weights, 20.0)
    away = project(fit.homographies, POINTS) - project(true, POINTS)
    assert np.abs(away[:, 3]).max() < 0.1


def test_three_points_give_a_map_without_perspective() -> None:
    true = homographies(5)
    images = project(true, POINTS)
    weights = np.zeros((5, 6))
    weights[:, [0, 1, 3]] = 1.0
    fit = fit_homographies(POINTS, images, weights, 20.0)
    assert np.abs(fit.homographies[:, 2, :2]).max() < 1e-4
    away = project(fit.homographies, POINTS) - images
    assert np.abs(away[:, [0, 1, 3]]).max() < 1e-3


def test_covariances_are_those_of_the_errors() -> None:
    true = np.repeat(homographies(1), 4000, axis=0)
    generator = np.random.default_rng(5)
    images = project(true, POINTS) + generator.normal(0, 0.1, (4000, 6, 2))
    fit = fit_homographies(POINTS, images, np.full((4000, 6), 100.0), 20.0)
    errors = fit.homographies[:, :2, 2] - true[:, :2, 2]
    found = np.cov(errors.T)
    assert found == pytest.approx(fit.covariance.mean(axis=0), rel=0.2, abs=2e-4)


def test_centres_of_ellipses_are_those_of_the_projected_circle() -> None:
    (true,) = homographies(1)
    true[2, :2] = (0.006, -0.004)
    angles = 2 * np.pi * np.arange(720) / 720
    for point, radius in zip(POINTS, (1.5, 2, 2.5, 3, 3.5, 4), strict=True):
        circle = point + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        x, y = project(true[None], circle)[0].T
        # The conic through the image of the circle.
        conic = np.linalg.svd(np.stack([x * x, x * y, y * y, x, y, 0 * x + 1], axis=1))[2][-1]
        a, b, c, d, e, _ = conic
        centre = np.linalg.solve([[2 * a, b], [b, 2 * c]], [-d, -e])
        found = ellipse_centres(true[None], point[None], np.array([radius]))[0, 0]
        assert found == pytest.approx(centre, abs=1e-6)
        assert np.hypot(*(found - project(true[None], point[None])[0, 0])) > 0.01


def test_frames_are_right_handed_and_have_the_size_of_the_circle() -> None:
    true = homographies(6)
    frames = local_frames(true, POINTS, np.full(6, 1e-3))
    assert (np.linalg.det(frames[..., :2, :2]) > 0).all()
    shift = np.array([5e-4, 0])
    step = (project(true, POINTS + shift) - project(true, POINTS - shift))[..., None]
    size = np.linalg.norm(np.linalg.solve(frames[..., :2, :2], step), axis=2)
    assert size == pytest.approx(1, abs=1e-6)
    major, minor, _ = ellipse_axes(frames.reshape(-1, 3, 3))
    assert (major >= minor).all()
