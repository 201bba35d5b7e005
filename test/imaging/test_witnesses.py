"""Targets that tell whether a scene moved."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.imaging.movement import Displacement, targets_moved
from ahf_ros.target import Target

PLACES = np.random.default_rng(0).uniform(0, 100, (9, 2))


def targets(x: float, noise: float) -> list[Target]:
    places = PLACES + np.random.default_rng(1).normal(0, noise, PLACES.shape)
    return [Target(number, 0, px + x, py, 5.0, 5.0) for number, (px, py) in enumerate(places)]


@pytest.mark.parametrize(
    ('moved', 'shift', 'noise', 'told'),
    [
        (Displacement(0.9, 0.1, 0.05), 0.0, 0.05, False),
        (Displacement(0.9, 0.1, 0.05), 0.9, 0.05, True),
        (Displacement(-0.4, 0.4, 0.05), 0.6, 0.05, True),
        (Displacement(0.1, 0.0, 0.01), 0.1, 0.005, True),
        (Displacement(0.1, 0.0, 0.01), 0.0, 0.3, None),
        (Displacement(0.9, 0.1, 0.05, (0, 0, 10, 10)), 0.9, 0.05, None),
    ],
)
def test_targets_tell_a_movement_or_too_few_do(moved, shift, noise, told):
    assert targets_moved(moved, targets(0.0, 0.0), targets(shift, noise)) is told
