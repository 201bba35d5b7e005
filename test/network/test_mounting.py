"""Cameras on a robot's hand, beside its base and on each other, against what was simulated."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip('scipy', reason='the adjustment needs scipy')

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.mounting import Station, mounted
from ahf_ros.network.network import CameraView
from ahf_ros.network.solution import Solution
from ahf_ros.network.stations import mounted_on_rig, mounted_on_robot
from ahf_ros.network.transform import Transform
from support.network_scenes import Field, simulate

HAND_SIGMA = np.array([1e-4] * 3 + [3e-4] * 3)
SEEN_SIGMA = np.array([0.05] * 3 + [2e-4] * 3)  # in mm and rad


def pose(random: np.random.Generator, length: float, turn: float) -> Transform:
    return Transform(
        np.asarray(cv2.Rodrigues(random.normal(0, turn, 3))[0]), random.normal(0, length, 3)
    )


def simulated(
    random: np.random.Generator,
    mount: Transform,
    base: Transform,
    count: int = 12,
    turn: float = 0.5,
) -> list[Station]:
    stations = []
    hand_covariance, seen_covariance = np.diag(HAND_SIGMA**2), np.diag(SEEN_SIGMA**2)
    for number in range(count):
        robot = pose(random, 0.5, turn)
        seen = (base.inverse @ robot @ mount).scaled(1e3)
        robot = robot.stepped(random.normal(0, HAND_SIGMA))
        seen = seen.stepped(random.normal(0, SEEN_SIGMA))
        stations.append(
            Station(
                name=f'{number}.jpg',
                place=number,
                camera='camera',
                robot=replace(robot, covariance=hand_covariance),
                seen=replace(seen, covariance=seen_covariance),
            )
        )
    return stations


@pytest.mark.lasting
@pytest.mark.parametrize('targets_on_hand', [False, True])
@pytest.mark.parametrize('scale', [None, 1e-3])
def test_covariances_are_those_of_the_errors(targets_on_hand: bool, scale: float | None) -> None:
    random = np.random.default_rng(3)
    squares = []
    for _ in range(60):
        mount, base = pose(random, 0.1, 1), pose(random, 1, 1)
        result = mounted(
            simulated(random, mount, base), targets_on_hand=targets_on_hand, scale=scale
        )
        assert not result.rejected
        assert abs(result.scale - 1e-3) <= 6 * result.scale_sigma
        found = *result.mounts.values(), *result.fields.values()
        for truth, estimate in zip((mount, base), found, strict=True):
            gap = estimate.step_from(truth)
            squares.append(gap @ np.linalg.solve(estimate.covariance, gap))
    # The mean of 120 values of chi-square, six degrees, of which two are of one run each.
    assert 5 < np.mean(squares) < 7.4


def test_a_wrong_pose_is_named() -> None:
    random = np.random.default_rng(4)
    mount, base = pose(random, 0.1, 1), pose(random, 1, 1)
    stations = simulated(random, mount, base)
    moved = stations[5].robot.stepped(np.array([0.005, 0, 0, 0, 0, 0]))
    stations[5] = replace(stations[5], robot=moved)
    result = mounted(stations, scale=1e-3)
    assert list(result.rejected) == ['5.jpg']
    assert np.abs(result.mounts['camera'].step_from(mount))[:3].max() < 5e-4


def test_turns_about_one_axis_are_refused() -> None:
    random = np.random.default_rng(5)
    mount, base = pose(random, 0.1, 1), pose(random, 1, 1)
    stations = [
        replace(
            it,
            robot=Transform(
                np.asarray(cv2.Rodrigues((0, 0, 0.1 * number))[0]), it.robot.translation
            ),
        )
        for number, it in enumerate(simulated(random, mount, base))
    ]
    with pytest.raises(ValueError, match=r'about one axis only: about others by 0.[0-9] degrees'):
        mounted(stations, scale=1e-3)


@pytest.fixture(scope='module')
def network() -> Solution:
    """A network in mm, of two cameras that are fixed to each other."""
    scene, truth = simulate(Field(photographs=24), np.random.default_rng(6))
    views = tuple(CameraView(name, 4000, 3000, 3200) for name in ('left', 'right'))
    truth = replace(
        truth,
        points=500 * truth.points,
        positions=500 * truth.positions,
        calibrations=np.repeat(truth.calibrations, 2, axis=0),
    )
    scene = replace(scene, cameras=views, camera_of=np.arange(24) % 2, unit='mm')
    return adjust(scene, truth)


def robot_poses(network: Solution, mount: Transform, base: Transform) -> dict[str, Transform]:
    """Return exact poses of the hand, in metres, for all photographs of the left camera."""
    poses = {}
    for index in range(0, len(network.state.positions), 2):
        seen = Transform(network.state.rotations[index].T, 1e-3 * network.state.positions[index])
        poses[network.network.photographs[index]] = base @ seen @ mount.inverse
    return poses


def in_mm(poses: dict[str, Transform]) -> dict[str, Transform]:
    return {name: it.scaled(1e3) for name, it in poses.items()}


SIGMAS = {'position_sigma': 1e-4, 'rotation_sigma': 3e-4}


def test_the_unit_of_a_robot_is_told_by_the_scale_of_the_network(network: Solution) -> None:
    random = np.random.default_rng(8)
    mount, base = pose(random, 0.1, 1), pose(random, 1, 1)
    poses = robot_poses(network, mount, base)
    for given in (poses, in_mm(poses)):
        result, notes = mounted_on_robot(network, given, **SIGMAS)
        assert np.abs(result.mounts['left'].step_from(mount)).max() < 1e-8
        assert any('no pose of the robot for 1.jpg' in it for it in notes)
    with pytest.raises(
        ValueError, match="robot_unit is 'm', and the poses of the robot are in mm"
    ):
        mounted_on_robot(network, in_mm(poses), unit='m', **SIGMAS)
    feet = {name: it.scaled(3.28) for name, it in poses.items()}
    with pytest.raises(ValueError, match='accepted is 1: check the scale'):
        mounted_on_robot(network, feet, **SIGMAS)


def test_a_network_without_scale_gets_that_of_the_robot(network: Solution) -> None:
    random = np.random.default_rng(9)
    mount, base = pose(random, 0.1, 1), pose(random, 1, 1)
    poses = in_mm(robot_poses(network, mount, base))
    bare = replace(network, network=replace(network.network, unit=''))
    with pytest.raises(ValueError, match='robot_unit is not given'):
        mounted_on_robot(bare, poses, **SIGMAS)
    result, _ = mounted_on_robot(bare, poses, unit='mm', **SIGMAS)
    assert result.scale == pytest.approx(1e-3, rel=1e-6)
    assert np.abs(result.mounts['left'].step_from(mount)).max() < 1e-8


def test_inverted_poses_are_recognised(network: Solution) -> None:
    random = np.random.default_rng(10)
    poses = robot_poses(network, pose(random, 0.1, 1), pose(random, 1, 1))
    inverted = {name: it.inverse for name, it in poses.items()}
    with pytest.raises(
        ValueError, match='accepted are those of the hand in the frame of the base'
    ):
        mounted_on_robot(network, inverted, **SIGMAS)


def test_a_rig_of_two_cameras(network: Solution) -> None:
    """The right camera is put where a rig would have it; its photographs stay those of it."""
    random = np.random.default_rng(11)
    truth = Transform(
        np.asarray(cv2.Rodrigues(random.normal(0, 0.3, 3))[0]), np.array([0.2, 0, 0.01])
    )
    rotations, positions = network.state.rotations.copy(), network.state.positions.copy()
    for index in range(0, len(positions), 2):
        left = Transform(rotations[index].T, 1e-3 * positions[index])
        right = left @ truth
        rotations[index + 1], positions[index + 1] = right.rotation.T, 1e3 * right.translation
    rig = replace(network, state=replace(network.state, rotations=rotations, positions=positions))
    stations = {name: str(index // 2) for index, name in enumerate(network.network.photographs)}
    reference, result, _ = mounted_on_rig(rig, stations)
    assert reference == 'left'
    assert np.abs(result.mounts['right'].step_from(truth)).max() < 1e-8
    with pytest.raises(ValueError, match='has two images of left, accepted is one'):
        mounted_on_rig(rig, dict.fromkeys(stations, 'one'))
    with pytest.raises(ValueError, match='no scale in a known unit'):
        mounted_on_rig(replace(rig, network=replace(rig.network, unit='')), stations)
