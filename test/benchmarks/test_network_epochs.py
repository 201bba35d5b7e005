"""The benchmark of the congruence test, with few runs."""

import numpy as np

from benchmarks.network_epochs import figures
from support.simulated_epochs import Epoch, Field

FIELD = Field('small', (1.0, 0.8, 0.6), 8, 6)


def test_epochs_have_the_errors_that_they_say() -> None:
    source = np.random.default_rng(1)
    xyz = source.uniform(-0.5, 0.5, (8, 3)) * FIELD.extent
    epoch = Epoch(xyz, 6, True, source)
    values = np.linalg.eigvalsh(epoch.covariance)
    assert (values > 1e-9 * values[-1]).sum() == 3 * 8 - 6
    squares, variances = [], []
    weights = np.linalg.pinv(epoch.covariance, 1e-9, hermitian=True)
    for _ in range(300):
        errors = source.standard_normal(len(epoch.design))
        change = epoch.gain @ errors
        squares.append(change[:24] @ weights @ change[:24])
        variances.append(errors @ (errors - epoch.design @ change) / epoch.redundancy)
    assert abs(np.mean(squares) - 18) < 5 * np.sqrt(2 * 18 / 300)
    assert abs(np.mean(variances) - 1) < 5 * np.sqrt(2 / epoch.redundancy / 300)


def test_the_test_raises_few_false_alarms_and_finds_most_movements() -> None:
    row = figures(FIELD, False, 60, np.random.default_rng(2))
    assert row['false_alarms'] <= 0.15  # of 60 runs, at 5 %
    assert row['located'] >= 0.7
    assert row['conditional_bound'] >= 0.9
