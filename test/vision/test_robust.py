"""Robust statistics: exact without outliers, and little moved by them."""

import numpy as np
import pytest

from ahf_ros.vision.robust import (
    fit_linear,
    geman_mcclure_gain,
    median,
    quantiles,
)
from ahf_ros.vision.robust import spread as robust_spread


def test_medians_are_those_of_the_selected_values() -> None:
    values = np.array([[5.0, 1, 9, 3], [5, 1, 9, 3], [5, 1, 9, 3]])
    selected = np.array([[1, 1, 1, 0], [1, 1, 1, 1], [0, 0, 0, 0]], bool)
    assert median(values, selected, 7.0).tolist() == [5, 3, 7]  # the lower one of an even number


def test_the_spread_of_normal_errors_is_their_deviation_despite_outliers() -> None:
    errors = np.abs(np.random.default_rng(0).normal(0, 2.0, (1, 4000)))
    errors[:, :200] = 1e6
    everything = np.ones_like(errors, bool)
    assert robust_spread(errors, everything, 0.1)[0, 0] == pytest.approx(2.0, rel=0.1)
    assert robust_spread(0 * errors, everything, 0.1).tolist() == [[0.1]]


def test_the_gain_is_the_derivative_of_the_weighted_error() -> None:
    errors, step = np.linspace(-3, 3, 25), 1e-6
    numeric = (
        (errors + step) / (1 + (errors + step) ** 2) ** 2
        - (errors - step) / (1 + (errors - step) ** 2) ** 2
    ) / (2 * step)
    assert geman_mcclure_gain(np.ones(25), errors) == pytest.approx(numeric, abs=1e-6)


def test_a_linear_model_is_found_despite_outliers() -> None:
    generator = np.random.default_rng(0)
    basis = np.stack([np.ones(40), np.linspace(-1, 1, 40)], axis=1)
    true = np.array([[0.2, 0.1], [-0.3, 0.05]])
    values = true @ basis.T + 0.01 * generator.standard_normal((2, 40))
    values[:, :10] += 1.0
    found, residuals = fit_linear(values, np.ones((2, 40)), basis, scale=0.05, rounds=8)
    assert found == pytest.approx(true, abs=0.02)
    assert np.abs(residuals[:, :10]).min() > 0.8
    assert residuals == pytest.approx(values - found @ basis.T)


def test_values_without_weight_do_not_count() -> None:
    basis = np.ones((6, 1))
    values = np.array([[1.0, 1, 1, 9, 9, 9]])
    weights = np.array([[1.0, 1, 1, 0, 0, 0]])
    found, _ = fit_linear(values, weights, basis, scale=10.0)
    assert found[0, 0] == pytest.approx(1, abs=1e-2)


@pytest.mark.parametrize('count', [1, 2, 32, 64])
def test_quantiles_are_those_of_numpy(count: int) -> None:
    values = np.random.default_rng(count).normal(size=(5, count))
    for share in (0.0, 0.2, 0.35, 1.0):
        assert quantiles(values, share) == pytest.approx(np.quantile(values, share, axis=1))
