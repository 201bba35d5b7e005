"""Frames fitted to edges: where the centre is, and how well it is known."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.detectors.edges import refined
from ahf_ros.frame import affine_frames, ellipse_axes

CENTRE = np.array([30.3, 27.8])


def dot(gray: float, ground: float, radius: float = 8.0, factor: int = 16) -> np.ndarray:
    """Return a disc, each pixel averaged over its area."""
    fine = (np.arange(60 * factor) + 0.5) / factor - 0.5
    inside = np.hypot(fine - CENTRE[0], fine[:, None] - CENTRE[1]) < radius
    share = inside.reshape(60, factor, 60, factor).mean(axis=(1, 3))
    return (ground + (gray - ground) * share).astype(np.float32)


@pytest.mark.parametrize(('gray', 'ground'), [(20, 200), (200, 20)])
def test_the_centre_and_the_axes_of_a_dot(gray, ground):
    start = affine_frames([31.2], [27.2], [9.0], [7.0], [0.4])
    frames, covariances, scatter = refined(dot(gray, ground), start)
    frames, covariances, scatter = refined(dot(gray, ground), frames)
    np.testing.assert_allclose(frames[0, :2, 2], CENTRE, atol=0.01)
    np.testing.assert_allclose([axis[0] for axis in ellipse_axes(frames)[:2]], 8.0, atol=0.03)
    assert scatter[0] < 0.01
    assert 0 < np.trace(covariances[0]) < 1e-4


def test_noise_shows_in_the_covariance():
    generator = np.random.default_rng(5)
    start = affine_frames([CENTRE[0]], [CENTRE[1]], [8.0], [8.0], [0.0])
    errors, variances = [], []
    for _ in range(60):
        image = dot(20, 200) + generator.normal(0, 10, (60, 60)).astype(np.float32)
        frames, covariances, _ = refined(image, start)
        errors.append(frames[0, :2, 2] - CENTRE)
        variances.append(np.trace(covariances[0]) / 2)
    assert np.mean(variances) == pytest.approx(np.var(errors), rel=0.5)


def test_what_is_no_dot_does_not_fit():
    image = np.full((60, 60), 200, np.float32)
    image[:, 30:] = 20
    _, _, scatter = refined(image, affine_frames([30.0], [30.0], [8.0], [8.0], [0.0]))
    assert np.isinf(scatter[0])


def test_no_frames():
    frames, covariances, scatter = refined(dot(20, 200), np.zeros((0, 3, 3)))
    assert (frames.shape, covariances.shape, scatter.shape) == ((0, 3, 3), (0, 2, 2), (0,))
