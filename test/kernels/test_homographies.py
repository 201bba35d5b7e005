"""Fitted homographies, against the same least squares in numpy."""

import numpy as np
import pytest

from ahf_ros import kernels

PERSPECTIVE, WEAK, SHALLOWEST = 150.0, 1e-9, 0.2


def plain(points: np.ndarray, images: np.ndarray, weights: np.ndarray, reach: float) -> tuple:
    """Return the homography of one object, and the covariance of its centre."""
    share = np.trace(weights, axis1=1, axis2=2)
    middle = np.average(images, axis=0, weights=share)
    size = np.sqrt(np.average(((images - middle) ** 2).sum(axis=1), weights=share))
    points, images = points / reach, (images - middle) / size
    found = np.zeros(8)
    for _ in range(3):
        normal, right = np.diag([WEAK] * 6 + [PERSPECTIVE] * 2), np.zeros(8)
        for (x, y), (u, v), weight in zip(points, images, weights, strict=True):
            depth = max(1 + found[6] * x + found[7] * y, SHALLOWEST)
            rows = np.array(
                [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
            )
            rows /= depth
            normal += rows.T @ weight @ rows * size**2
            right += rows.T @ weight @ [u, v] * size**2 / depth
        found = np.linalg.solve(normal, right)
    back = np.array([[size, 0, middle[0]], [0, size, middle[1]], [0, 0, 1]])
    homography = back @ np.append(found, 1).reshape(3, 3) @ np.diag([1 / reach, 1 / reach, 1])
    return homography, np.linalg.inv(normal)[np.ix_([2, 5], [2, 5])] * size**2


@pytest.mark.parametrize('seed', range(8))
def test_homographies_are_those_of_least_squares(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count, several = 1 + seed, 4 + seed
    points, reach = generator.uniform(-15, 15, (count, several, 2)), 20.0
    images = points * [5, -4] + generator.uniform(100, 900, (count, 1, 2))
    images += generator.normal(0, [0.1, 8.0][seed % 2], images.shape)
    roots = generator.normal(0, 2, (count, several, 2, 2))
    weights = roots @ roots.swapaxes(2, 3)
    if seed % 3 == 0:
        weights[:, 0] = 0
    given = points, images, weights, reach, WEAK, PERSPECTIVE, SHALLOWEST, 3
    found = kernels.fitted_homographies(*given)
    for *of_object, homography, covariance in zip(points, images, weights, *found, strict=True):
        expected = plain(*of_object, reach)
        assert homography == pytest.approx(expected[0], rel=1e-7, abs=1e-9)
        assert covariance == pytest.approx(expected[1], rel=1e-7, abs=1e-12)


@pytest.mark.parametrize('strange', [np.nan, np.inf, 0.0, 1e300])
def test_strange_values_are_borne(strange: float) -> None:
    points = np.full((2, 5, 2), strange)
    given = points, points, np.ones((2, 5, 2, 2)), 1.0, WEAK, PERSPECTIVE, SHALLOWEST, 3
    assert kernels.fitted_homographies(*given)[0].shape == (2, 3, 3)
