"""The pose of one image: covariances by Monte Carlo, wrong IDs, second poses, and refusals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ahf_ros import Target, resect
from ahf_ros.network.camera import project, rotation_matrices
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.transform import Transform
from benchmarks.registration import posed
from support.poses import CAMERA, View, error, normalised_square, view, with_wrong_id


def seeded(*numbers: int) -> np.random.Generator:
    return np.random.default_rng(numbers)


def scene(width: float = 1.0, depth: float = 0.2, seed: int = 3) -> View:
    return view(width, depth, seeded(seed))


def some(of: View, count: int) -> View:
    return replace(of, targets=of.targets[:count])


def located(of: View, **changes: Any) -> Any:
    given = {'targets': of.targets, 'points': of.points, 'calibration': CAMERA, **changes}
    return resect(**given)


@pytest.mark.lasting
@pytest.mark.parametrize(('width', 'depth'), [(1.0, 0.0), (1.0, 0.2), (0.1, 0.0)])
def test_errors_are_as_large_as_covariances_say(width: float, depth: float) -> None:
    counts = posed(width, depth, seed=11, runs=100)
    assert np.mean(counts.squares) == pytest.approx(6, abs=1.05)  # three standard deviations
    assert (counts.refused, counts.flipped, counts.good_rejected) == (0, 0, 0)
    assert counts.named == counts.wrong == 5
    assert counts.moved < 1e-3


def test_a_fisheye_camera_sees_targets_far_off_its_axis() -> None:
    """Up to 70 degrees; one has a wrong ID."""
    lens = np.array([620.0, 805.0, 596.0, 0.03, -0.01, 0.004, -0.002, 0.0, 0.0, 0.0])
    squares = []
    for seed in range(40):
        random = seeded(5, seed)
        angles, around = random.uniform((0, 0), (1.2, 2 * np.pi), (24, 2)).T
        aside = np.sin(angles) * (np.cos(around), np.sin(around))
        xyz = (random.uniform(1, 2, 24) * (*aside, np.cos(angles))).T
        turn = rotation_matrices(random.normal(size=(1, 3)))[0]
        true = Transform(turn, random.normal(size=3))
        known = xyz @ turn.T + true.translation
        points = MeasuredPoints(tuple(map(str, range(24))), known, np.zeros((72, 72)), unit='m')
        seen = project(lens, turn.T, true.translation, known, equidistant=True)
        seen += random.normal(0, 0.05, seen.shape)
        covariance = (0.0025, 0.0, 0.0, 0.0025)
        targets = [
            Target(number, 0, x, y, 8.0, 8.0, covariance=covariance)
            for number, (x, y) in enumerate(seen.tolist())
        ]
        targets[2:4] = [replace(targets[2], id=3)]
        pose = resect(targets, points, lens, equidistant=True)
        assert [it.target for it in pose.rejected] == ['3']
        squares.append(normalised_square(pose.camera, true))
    assert np.mean(squares) == pytest.approx(6, abs=4 * np.sqrt(12 / 40))


def test_covariances_are_about_the_fixed_axes_of_the_frame() -> None:
    """Their entries, from many images of one scene, also of the inverse transform."""
    of = scene()
    exact = MeasuredPoints(of.points.names, of.points.xyz, np.zeros_like(of.points.covariance))
    true = located(of, points=exact).camera
    rows = exact.indices([str(it.id) for it in of.targets])
    seen = project(CAMERA, true.rotation.T, true.translation, exact.xyz[rows])
    roots = np.linalg.cholesky([np.reshape(it.covariance, (2, 2)) for it in of.targets])
    found = []
    for number in range(300):
        noise = (roots @ seeded(4, number).normal(size=(len(seen), 2, 1)))[:, :, 0]
        targets = [
            replace(it, x=float(x), y=float(y))
            for it, (x, y) in zip(of.targets, seen + noise, strict=True)
        ]
        found.append(located(of, targets=targets, points=exact).camera)
    for poses, truth in ((found, true), ([it.inverse for it in found], true.inverse)):
        covariance = np.mean([it.covariance for it in poses], axis=0)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        whitened = root @ np.cov(np.transpose([error(it, truth) for it in poses])) @ root.T
        # Standard deviations are 0.08 on the diagonal, 0.06 beside it.
        assert np.abs(whitened - np.eye(6)).max() < 0.25
        assert np.diag(covariance).min() > 0


def test_a_wrong_id_is_named_with_the_target_that_is_there() -> None:
    of = scene()
    first, second, *others = of.targets
    wrong = replace(first, id=second.id)
    pose = located(of, targets=[wrong, *others])
    (rejected,) = pose.rejected
    assert rejected.target == str(second.id)
    assert rejected.reason == f'wrong ID: the place of target {first.id}'
    assert rejected.normalised_residual > 10
    without = located(of, targets=others)
    assert normalised_square(pose.camera, without.camera) < 1e-6
    assert set(pose.targets) == set(without.targets)


def test_a_third_of_wrong_ids_is_left_out() -> None:
    of = scene()
    count = len(of.targets) // 3
    turned = [
        replace(it, id=of.targets[(index + 1) % count].id)
        for index, it in enumerate(of.targets[:count])
    ]
    pose = located(of, targets=[*turned, *of.targets[count:]])
    assert {it.target for it in pose.rejected} == {str(it.id) for it in turned}
    assert normalised_square(pose.camera, of.true) < 30


def test_an_id_that_is_there_twice_is_set_aside() -> None:
    of = scene()
    again = replace(of.targets[0], x=of.targets[0].x + 300)
    pose = located(of, targets=[*of.targets, again])
    assert [it.reason for it in pose.rejected] == ['its ID is in this image twice'] * 2


def test_a_small_plane_has_a_second_pose() -> None:
    """It is marked where it may be the true one, and never taken for it without a mark."""
    counts = posed(0.05, 0.0, seed=5, runs=60)
    assert counts.ambiguous >= 1
    assert counts.flipped == 0
    marked = [
        located(view(0.05, 0.0, seeded(5, 500, 0, number))).second for number in range(1, 20)
    ]
    found = [it for it in marked if it]
    assert all(np.isfinite(it.covariance).all() for it in found)


def test_covariances_that_are_too_small_are_scaled() -> None:
    of = scene()
    small = [replace(it, covariance=tuple(np.array(it.covariance) / 25)) for it in of.targets]
    exact = replace(of.points, covariance=0 * of.points.covariance)
    usual, scaled = located(of, points=exact), located(of, targets=small, points=exact)
    assert scaled.sigma0 == pytest.approx(5 * usual.sigma0, rel=0.1)
    for pose in (usual, scaled):
        assert pose.sigma0 > 1.2  # the coordinates have errors that they do not tell
    assert np.allclose(scaled.camera.covariance, usual.camera.covariance, rtol=1e-3)


def test_centres_without_a_covariance_have_that_of_sigma() -> None:
    of = scene()
    bare = [replace(it, covariance=(0.0,) * 4) for it in of.targets]
    pose = located(of, targets=bare, sigma=0.2)
    assert np.linalg.eigvalsh(pose.camera.covariance)[0] > 0
    assert pose.redundancy == 2 * len(bare) - 6


def test_families_name_targets_where_coordinates_have_them() -> None:
    of = scene()
    named = replace(of.points, names=tuple(f'cct12:{name}' for name in of.points.names))
    targets = [replace(it, family='cct12') for it in of.targets]
    others = [replace(it, family='cct14', x=it.x + 50) for it in of.targets]
    pose = located(of, targets=[*others, *targets], points=named)
    assert set(pose.targets) == set(named.names)
    assert pose.rejected == ()


@pytest.mark.parametrize('scale', [1e-3, 1e3])
def test_the_unit_makes_no_difference(scale: float) -> None:
    of = scene()
    other = replace(
        of.points, xyz=scale * of.points.xyz, covariance=scale**2 * of.points.covariance
    )
    pose, scaled = located(of), located(of, points=other)
    assert np.allclose(scaled.camera.translation, scale * pose.camera.translation)
    assert np.allclose(scaled.camera.rotation, pose.camera.rotation)
    assert np.allclose(scaled.camera.covariance[3:, 3:], pose.camera.covariance[3:, 3:])


def test_garbage_is_refused_and_nothing_else_happens() -> None:
    """Places and coordinates that no camera sees: all at one place, far away, not finite."""
    random = seeded(9)
    for number in range(150):
        count = int(random.integers(4, 12))
        xyz = random.choice([1e-9, 1.0, 1e6]) * random.normal(size=(count, 3))
        xy = random.choice([0, 1e-9, 1e9]) * random.normal(size=(count, 2)) + 900
        if number % 5 == 0:
            xy[0] = np.nan
        points = MeasuredPoints(tuple(map(str, range(count))), xyz, np.zeros((3 * count,) * 2))
        targets = [Target(index, 0, *place, 5.0, 5.0) for index, place in enumerate(xy)]
        with pytest.raises(ValueError, match=r'target'):
            resect(targets, points, CAMERA)


def line(bend: float) -> View:
    """Return an image of targets on a line, or nearly."""
    of = scene()
    along = np.linspace(-0.5, 0.5, len(of.points.names))
    xyz = np.column_stack((along, bend * np.cos(20 * along), bend * np.sin(13 * along)))
    rotation, position = np.diag([1.0, -1.0, -1.0]), np.array([0, 0, 2.0])
    seen = project(CAMERA, rotation, position, xyz)
    targets = tuple(
        Target(it.id, 0, float(x), float(y), 8.0, 8.0, covariance=(0.25, 0, 0, 0.25))
        for it, (x, y) in zip(of.targets, seen, strict=True)
    )
    points = MeasuredPoints(of.points.names, xyz, np.zeros((3 * len(xyz), 3 * len(xyz))))
    return View(targets, points, of.true)


def mirrored(of: View) -> View:
    return replace(of, points=replace(of.points, xyz=of.points.xyz * (1, 1, -1)))


@pytest.mark.parametrize(
    ('of', 'words'),
    [
        (some(scene(), 3), r'3 targets with known coordinates in the image, 4 are needed'),
        (some(scene(), 0), r'0 targets with known'),
        (line(0.0), 'targets are on a line'),
        (line(0.0005), 'do not determine the pose, they are nearly on a line: its standard'),
        (some(with_wrong_id(scene(), seeded(2)), 4), ''),
        (
            mirrored(scene(depth=0.5)),
            '% of the extent of the targets in the image, accepted are 2 %',
        ),
    ],
)
def test_what_is_not_determined_is_refused_with_the_reason(of: View, words: str) -> None:
    if not words:
        first, second, *others = of.targets
        swapped = (replace(first, id=second.id), replace(second, id=first.id), *others)
        of, words = replace(of, targets=swapped), 'contradict each other, and which one is wrong'
    with pytest.raises(ValueError, match=words):
        located(of)


def test_targets_that_are_left_out_are_told_where_too_few_remain() -> None:
    of = some(scene(), 5)
    again = [replace(it, x=it.x + 99) for it in of.targets[:2]]
    with pytest.raises(ValueError, match=r'3 targets with .*; left out: 1, 2, .*, its ID is in'):
        located(of, targets=[*of.targets, *again])


@pytest.mark.parametrize('calibration', [np.zeros(10), CAMERA[:9], np.full(10, np.nan)])
def test_a_camera_that_is_none_is_refused(calibration: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r'calibration is .*, accepted are 10 finite numbers, f'):
        located(scene(), calibration=calibration)
