"""Covariances of edges: errors in common make them larger, errors of single edges do not."""

import numpy as np
import pytest

from ahf_ros.vision.edge_errors import common_errors, edge_covariance

EDGES = 200


def covariances(errors: np.ndarray, spacing: float = 3.0) -> np.ndarray:
    """Return the variances of means of errors, shape (k, m), as stated."""
    parts = np.stack([errors, np.zeros_like(errors)], axis=1) / EDGES
    ones = np.ones_like(errors)
    common = common_errors(errors, np.zeros(EDGES))
    return edge_covariance(parts, ones, spacing * ones, 1, common)[:, 0, 0]


def test_independent_errors_have_hardly_anything_in_common() -> None:
    errors = np.random.default_rng(0).normal(size=(500, EDGES))
    growth = common_errors(errors, np.zeros(EDGES))
    assert growth.min() == 1
    assert growth.mean() < 1.2
    assert covariances(errors).mean() == pytest.approx(errors.mean(axis=1).var(), rel=0.25)


def test_errors_of_several_neighbours_count_together() -> None:
    once = np.random.default_rng(1).normal(size=(500, EDGES // 4))
    errors = np.repeat(once, 4, axis=1)
    stated, true = covariances(errors).mean(), errors.mean(axis=1).var()
    assert 0.7 < stated / true < 1.2
    alone = np.random.default_rng(2).permuted(errors, axis=1)
    assert covariances(alone).mean() < 0.5 * stated


def test_outlines_have_nothing_in_common() -> None:
    errors = np.repeat([[1.0, -1.0]], EDGES // 2, axis=1)
    assert common_errors(errors, np.arange(EDGES))[0] == 1
    assert common_errors(errors, np.zeros(EDGES))[0] > 5


def test_pixels_in_common_are_not_counted_twice() -> None:
    errors = np.repeat(np.random.default_rng(3).normal(size=(200, EDGES // 2)), 2, axis=1)
    far, near = covariances(errors, 3.0), covariances(errors, 0.9)
    assert (near >= 0.9 * far).all()
    assert near.mean() < 1.6 * far.mean()
