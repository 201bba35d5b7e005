"""Dots: pairs that are near to each other, and those that are the same."""

import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.dots import Dots, distinct, pairs_within


@pytest.mark.parametrize('part', [7, 100_000])
def test_pairs_are_those_within_reach_of_the_first(part: int) -> None:
    generator = np.random.default_rng(1)
    points = generator.uniform(-50, 400, (150, 2))
    reach = generator.uniform(5, 90, 150)
    parts = list(pairs_within(points, reach, part))
    first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
    gap = np.abs(points[:, None] - points).max(axis=2)
    expected = np.argwhere((gap < reach[:, None]) & ~np.eye(150, dtype=bool))
    assert (np.diff(first) >= 0).all()
    assert sorted(zip(first, second, strict=True)) == [tuple(pair) for pair in expected.tolist()]
    assert (len(parts) > 5) == (part == 7)
    firsts = [set(of_part.tolist()) for of_part, _ in parts]
    assert sum(map(len, firsts)) == len(set().union(*firsts))  # no point is in two parts


def test_one_point_and_none_have_no_neighbours() -> None:
    for count in (0, 1):
        parts = pairs_within(np.zeros((count, 2)), np.full(count, 9.0), 10)
        assert not sum(len(first) for first, _ in parts)


def test_points_that_ask_for_none_are_neighbours_of_others() -> None:
    points = np.array([[0.0, 0.0], [3.0, 0.0], [6.0, 0.0]])
    parts = list(pairs_within(points, np.array([0.0, 5.0, 0.0]), 10))
    first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
    assert first.tolist() == [1, 1]
    assert sorted(second.tolist()) == [0, 2]


def test_of_the_same_dot_found_twice_the_one_with_more_of_its_edge_is_kept() -> None:
    frames = frame.affine_frames([50.0, 51.0, 50.0, 80.0], [50.0] * 4, [10, 10, 20, 10], 10.0, 0.0)
    dots = distinct(Dots(frames, np.array([1, 1, 1, 1]), np.array([0.6, 0.9, 0.5, 0.7])))
    assert dots.share.tolist() == [0.9, 0.7, 0.5]  # another size is another dot
    either = distinct(Dots(frames[:2], np.array([1, -1]), np.array([0.6, 0.9])))
    assert either.polarity.tolist() == [-1, 1]
