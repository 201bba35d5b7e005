"""Control points are tested by each other: simulated misclosures, without photographs."""

from typing import Any

import numpy as np
import pytest

from ahf_ros.network.knowledge import Known
from ahf_ros.network.network import CameraView, ControlPoint, Network, Observations
from ahf_ros.network.suspects import Examined, examined

NOTHING = np.array([], int)
PRECISION = 1e-4  # of the photographs


def examination(
    count: int, surveyed: float, error: float, random: np.random.Generator
) -> Examined:
    """Return what is found of control points without sigma, of which point 0 has an error."""
    points = random.uniform(-1, 1, (20, 3))
    root = PRECISION * (np.eye(60) + 0.3 * random.standard_normal((60, 60)) / np.sqrt(60))
    measured = points + (root @ random.standard_normal(60)).reshape(-1, 3)
    towards = random.standard_normal(3)
    places = points[:count] + random.normal(0, surveyed, (count, 3))
    places[0] += error * towards / np.linalg.norm(towards)
    control = tuple(
        ControlPoint(str(number), place, np.zeros((3, 3))) for number, place in enumerate(places)
    )
    known = Known(
        (),
        NOTHING.reshape(0, 2),
        control,
        np.arange(count),
        NOTHING,
        None,
        (NOTHING, np.array([]), np.array([])),
    )
    observations = Observations(NOTHING, NOTHING, np.zeros((0, 2)), np.zeros((0, 2, 2)))
    names = tuple(map(str, range(20)))
    view = (CameraView('camera', 100, 100),)
    network = Network((), NOTHING, view, names, observations, control=control, unit='m')
    return examined(network, known, measured, root @ root.T, keep=False)


@pytest.mark.parametrize(('surveyed', 'error'), [(0.0, 14), (20 * PRECISION, 600)])
def test_one_wrong_point_of_eight_is_named_whatever_the_precision_of_the_others(
    surveyed: Any, error: int
) -> None:
    for seed in range(20):
        random = np.random.default_rng([31, seed])
        found = examination(8, surveyed, error * PRECISION, random)
        assert [(it.name, it.verdict) for it in found.suspects] == [
            ('control point 0', 'left out')
        ]
        assert [it.name for it in found.network.control if it.check] == ['0']
        believed = [np.sqrt(it.covariance[0, 0]) for it in found.network.control if not it.check]
        assert max(believed) == pytest.approx(surveyed, rel=0.8, abs=0)


def test_points_that_are_exact_but_for_a_small_error_stay_exact() -> None:
    found = examination(8, 0.0, 9 * PRECISION, np.random.default_rng(5))
    assert [it.name for it in found.suspects] == ['control point 0']
    assert not any(it.covariance.any() for it in found.network.control)
    assert not any('contradicts the photographs' in it for it in found.warnings)


@pytest.mark.parametrize('surveyed', [0.0, 2 * PRECISION, 20 * PRECISION])
def test_no_good_point_is_named(surveyed: Any) -> None:
    named = sum(
        len(examination(6, surveyed, 0.0, np.random.default_rng([32, seed])).suspects)
        for seed in range(40)
    )
    assert named == 0


def test_four_points_that_contradict_the_photographs_are_not_said_to_agree() -> None:
    found = examination(4, 50 * PRECISION, 0.0, np.random.default_rng(6))
    assert not found.suspects
    (warning,) = found.warnings
    assert 'contradicts the photographs' in warning
