"""Inner constraints and S-transformations."""

import numpy as np
import pytest

from ahf_ros.network.datum import movements, s_transform

RANDOM = np.random.default_rng(2)
POINTS = RANDOM.normal(size=(6, 3))
FACTOR = RANDOM.normal(size=(18, 18))


def test_datum_of_all_points_moves_none() -> None:
    _, covariance = s_transform(POINTS, FACTOR @ FACTOR.T, np.ones(6))
    np.testing.assert_allclose(movements(POINTS).T @ covariance, 0, atol=1e-12)


def test_the_way_to_a_datum_does_not_matter() -> None:
    some = np.array([1, 1, 1, 1, 0, 0])
    _, by_all = s_transform(POINTS, FACTOR @ FACTOR.T, np.ones(6))
    _, expected = s_transform(POINTS, FACTOR @ FACTOR.T, some)
    np.testing.assert_allclose(s_transform(POINTS, by_all, some)[1], expected, atol=1e-11)


@pytest.mark.parametrize('scale', [True, False])
def test_a_small_movement_is_undone(scale: bool) -> None:
    moved = POINTS + 1e-6 * np.cross([1, 2, 3], POINTS) + [2e-6, 0, 1e-6]
    moved += 1e-6 * POINTS if scale else 0
    back, _ = s_transform(moved, np.eye(18), np.ones(6), reference=POINTS, scale=scale)
    np.testing.assert_allclose(back, POINTS, atol=1e-10)


def test_two_points_are_no_datum() -> None:
    with pytest.raises(ValueError, match='the 2 weighted points define no datum'):
        s_transform(POINTS, np.eye(18), np.array([1, 1, 0, 0, 0, 0]))
