"""Elementary functions have the errors that the header states."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from ahf_ros import kernels

Values = np.ndarray


@pytest.mark.parametrize(
    ('name', 'exact', 'bounds', 'error'),
    [
        ('exponentials', math.exp, (-708.0, 709.0), 3e-16),
        ('logarithms', math.log, (1e-300, 1e300), 3e-16),
        ('logarithms', math.log, (0.5, 2.0), 3e-16),
        ('normal_shares', lambda x: math.erfc(-x / math.sqrt(2)) / 2, (-9.0, 9.0), 1.5e-7),
        ('exponentials_f', math.exp, (-87.0, 88.0), 2e-7),
        ('logarithms_f', math.log, (1e-37, 3e38), 2e-7),
    ],
)
def test_errors_are_as_documented(
    name: str, exact: Callable[[float], float], bounds: tuple[float, float], error: float
) -> None:
    low, high = bounds
    generator = np.random.default_rng(1)
    if name.startswith('log') and high > 2:
        x = np.exp(generator.uniform(math.log(low), math.log(high), 20_000))
    else:
        x = generator.uniform(low, high, 20_000)
    if name.endswith('_f'):
        x = x.astype(np.float32)
    truth = np.array([exact(float(it)) for it in x])
    found = getattr(kernels, name)(x).astype(float)
    relative = np.abs(truth) if name.startswith('exp') else np.maximum(np.abs(truth), 1)
    assert (np.abs(found - truth) / relative).max() < error


@pytest.mark.parametrize('name', ['exponentials', 'logarithms', 'exponentials_f', 'logarithms_f'])
def test_what_is_beyond_the_bounds_is_as_the_nearest_value(name: str) -> None:
    kernel = getattr(kernels, name)
    infinite, large = kernel([np.inf, -np.inf, np.nan]), kernel([1e38, -1e38, -1e38])
    assert np.isfinite(infinite).all()
    if name.startswith('exp'):
        assert infinite.tolist() == large.tolist()
    assert infinite[1] == infinite[2]
