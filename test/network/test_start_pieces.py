"""Relative orientation, planar poses, resection and triangulation on exact projections."""

from typing import Any

import numpy as np
import pytest

from ahf_ros.network.planar import is_flat, planar_poses
from ahf_ros.network.relative import relative_orientations
from ahf_ros.network.resection import ALIKE, resections
from ahf_ros.network.triangulation import intersect
from support.random_networks import looking

SIGMA = 2e-5


def view(
    direction: Any, distance: float = 4.0, roll: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    away = np.array(direction) / np.linalg.norm(direction)
    return looking(-away, roll), distance * away


def seen(points: np.ndarray, pose: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    places = (points - pose[1]) @ pose[0].T
    return places[:, :2] / places[:, 2:]


def field(number: int, depth: float) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (number, 3)) * [1, 1, depth]


def angle(rotation: np.ndarray, other: np.ndarray) -> float:
    return float(np.degrees(np.linalg.norm(rotation - other) / np.sqrt(2)))


ONE, OTHER = view([0.4, 0.1, 1]), view([-0.3, 0.5, 1], 3.5, 1.2)


@pytest.mark.parametrize('depth', [0.0, 0.5])
def test_relative_orientation_is_among_those_that_fit(depth: float) -> None:
    points = field(30, depth)
    first, second = seen(points, ONE), seen(points, OTHER)
    second[:2] = second[[1, 0]]  # two IDs exchanged
    found = relative_orientations(first, second, SIGMA)
    true = OTHER[0] @ ONE[0].T
    base = ONE[0] @ (OTHER[1] - ONE[1])
    best = min(found, key=lambda one: angle(one.rotation, true))
    assert angle(best.rotation, true) < 0.01
    assert best.position == pytest.approx(base / np.linalg.norm(base), abs=1e-3)
    assert not best.agrees[:2].any()
    assert best.agrees.sum() >= 27


def test_the_criterion_prefers_the_homography_of_a_plane() -> None:
    points = field(30, 0)
    noise = np.random.default_rng(2).normal(0, SIGMA, (2, 30, 2))
    first, second = seen(points, ONE) + noise[0], seen(points, OTHER) + noise[1]
    found = relative_orientations(first, second, SIGMA)
    assert found[0].criterion < found[-1].criterion
    assert min(angle(one.rotation, OTHER[0] @ ONE[0].T) for one in found[:2]) < 0.1


def test_too_few_common_points_have_no_relative_orientation() -> None:
    points = field(5, 0.5)
    assert relative_orientations(seen(points, ONE), seen(points, OTHER), SIGMA) == []


@pytest.mark.parametrize('depth', [0.0, 0.5])
def test_resection_with_wrong_ids(depth: float) -> None:
    points = field(20, depth)
    xy = seen(points, OTHER)
    xy[:3] = xy[[2, 0, 1]]
    best = resections(points, xy, np.full(20, SIGMA))[0]
    assert angle(best.rotation, OTHER[0]) < 1e-3
    assert best.position == pytest.approx(OTHER[1], abs=1e-4)
    assert np.array_equal(np.flatnonzero(~best.agrees), [0, 1, 2])


def test_both_poses_of_a_far_plane_are_kept() -> None:
    points = field(20, 0)
    pose = view([0.3, 0, 1], 2000)
    noise = np.random.default_rng(3).normal(0, SIGMA, (20, 2))
    first, second = resections(points, seen(points, pose) + noise, np.full(20, SIGMA))[:2]
    assert second.chi_square - first.chi_square < ALIKE
    assert min(angle(one.rotation, pose[0]) for one in (first, second)) < 8
    assert angle(first.rotation, second.rotation) > 20


def test_planar_poses_lie_before_the_camera_and_are_finite() -> None:
    points = field(12, 0)
    assert is_flat(points)
    assert not is_flat(field(12, 0.5))
    assert not is_flat(points * [1, 0, 0])
    for pose in planar_poses(points, seen(points, OTHER)):
        assert np.isfinite(pose[0]).all()
        assert (((points - pose[1]) @ pose[0].T)[:, 2] > 0).all()


def test_a_point_is_where_most_rays_meet() -> None:
    poses = [view(way) for way in ([0, 0, 1], [0.5, 0, 1], [0, 0.5, 1], [-0.5, 0, 1])]
    rotations, positions = (np.array(part) for part in zip(*poses, strict=True))
    point = np.array([0.2, -0.1, 0.3])
    xy = np.concatenate([seen(point[None], pose) for pose in poses])
    xy[2] += 0.1
    met = intersect(rotations, positions, xy, np.full(4, SIGMA))
    assert met is not None
    assert met.xyz == pytest.approx(point, abs=1e-9)
    assert met.agrees.tolist() == [True, True, False, True]


def test_rays_under_less_than_five_degrees_give_no_point() -> None:
    poses = [view([0, 0, 1]), view([0.05, 0, 1])]
    rotations, positions = (np.array(part) for part in zip(*poses, strict=True))
    xy = np.concatenate([seen(np.zeros((1, 3)), pose) for pose in poses])
    assert intersect(rotations, positions, xy, np.full(2, SIGMA)) is None
