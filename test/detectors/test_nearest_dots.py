"""Which dot is nearest."""

from __future__ import annotations

import numpy as np

from ahf_ros.detectors.gsi.grouping import NearestDots


def test_the_map_knows_the_nearest_of_dots_that_are_apart() -> None:
    generator = np.random.default_rng(2)
    x, y = np.meshgrid(30.0 * np.arange(9), 30.0 * np.arange(7))
    centres = np.stack([x.ravel(), y.ravel()], axis=1) + generator.uniform(-9, 9, (63, 2)) + 500
    nearest = NearestDots.of(centres, 0.0)
    places = centres + generator.uniform(-5, 5, centres.shape)
    found, distance = nearest.within(places, np.tile(2 * np.eye(2), (63, 1, 1)), 4.0)
    assert found.tolist() == list(range(63))
    assert np.allclose(distance, np.hypot(*(places - centres).T) / 2)


def test_nothing_is_found_beyond_the_reach_or_outside() -> None:
    nearest = NearestDots.of(np.array([[100.0, 100.0], [140.0, 100.0]]), 0.0)
    places = np.array([[112.0, 100.0], [-500.0, 9000.0], [133.0, 100.0]])
    found, _ = nearest.within(places, np.tile(np.eye(2), (3, 1, 1)), 10.0)
    assert found.tolist() == [-1, -1, 1]
