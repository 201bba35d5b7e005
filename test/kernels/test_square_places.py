"""Places of square markers, against plain loops."""

import math

import numpy as np
import pytest

from ahf_ros import kernels

SEEDS = range(4)


def scattered(seed: int) -> tuple[np.random.Generator, np.ndarray, np.ndarray]:
    """Return places of readings, some of them alike, and their reach."""
    generator = np.random.default_rng(seed)
    count = [1, 30, 60, 90][seed]
    return generator, generator.normal(0, 9, (count, 2)), generator.uniform(0, 6, count)


@pytest.mark.parametrize('seed', SEEDS)
def test_readings_of_one_place(seed: int) -> None:
    generator, places, reach = scattered(seed)
    count = len(places)
    groups, numbers = generator.integers(0, 3, (2, count))
    odds = generator.normal(0, 5, count)
    of_groups, of_numbers = kernels.place_rivals(places, reach, groups, numbers, odds, 0.0, -9.0)
    owning = [True] * count
    for i in range(count):
        others, numbered = [0.0], [-9.0]
        for j in range(count):
            if math.dist(places[i], places[j]) > max(reach[i], reach[j]):
                continue
            if groups[i] != groups[j]:
                others.append(odds[j])
            elif numbers[i] != numbers[j]:
                numbered.append(odds[j])
            if i < j and owning[i] and groups[i] == groups[j]:
                owning[j] = False
        assert (of_groups[i], of_numbers[i]) == (max(others), max(numbered))
    for most in (0, 1, 7, count):
        first = [own and sum(owning[:i]) < most for i, own in enumerate(owning)]
        assert kernels.place_owners(places, reach, groups, most).tolist() == first


@pytest.mark.parametrize('seed', SEEDS)
def test_places_that_are_taken(seed: int) -> None:
    generator, places, reach = scattered(seed)
    points = generator.normal(0, 9, (seed, 2))
    near = [
        any(math.dist(place, point) <= far for point in points.tolist())
        for place, far in zip(places.tolist(), reach.tolist(), strict=True)
    ]
    assert kernels.taken_places(places, reach, points).tolist() == near


def test_frames_have_the_corners() -> None:
    square = np.array([[-0.5, -0.5, 1], [0.5, -0.5, 1], [0.5, 0.5, 1], [-0.5, 0.5, 1]])
    corners = 50 * square[:, :2] + np.random.default_rng(1).normal(90, 9, (20, 4, 2))
    frames = kernels.square_frames(corners)
    images = square @ frames.swapaxes(1, 2)
    np.testing.assert_allclose(images[..., :2] / images[..., 2:], corners, atol=1e-9)
    np.testing.assert_array_equal(frames[:, 2, 2], 1.0)
    kernels.square_frames([np.zeros((4, 2)), np.full((4, 2), np.nan)])
