"""The stations of a network: where a robot's hand was, or which photographs a rig took at once."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import PurePath
from typing import TypeVar

import numpy as np

from ahf_ros.base.text import counted, listed
from ahf_ros.network.mounting import Contradiction, Mounted, Station, mounted
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import Solution
from ahf_ros.network.transform import Transform, camera_pose
from ahf_ros.network.units import METRES

ROBOT_UNITS = ('m', 'mm')

_Value = TypeVar('_Value')

_TOLERANCE = 0.1  # of the ratio of lengths, where units are told apart
_UNCERTAIN = 0.05  # relative standard deviation of a ratio that tells nothing
_SIGNIFICANT = 4.0  # standard deviations
_INVERTED = 0.5  # ratio of sigma0 with inverted poses, which then are the right ones


def mounted_on_robot(
    solution: Solution,
    robot_poses: Mapping[str, Transform],
    *,
    position_sigma: float,
    rotation_sigma: float,
    unit: str = '',
    targets_on_hand: bool = False,
) -> tuple[Mounted, tuple[str, ...]]:
    """Return in metres where the cameras of a network, or its targets, are on a robot; and notes.

    `robot_poses` are of the hand in the frame of the base, by image. Their standard deviations
    are in m and rad. Their `unit`, m or mm, is told by a network that has a scale; a unit that
    contradicts it is refused with a ValueError.
    """
    poses, notes = _matched(solution, robot_poses)
    metres = METRES.get(solution.network.unit)
    if metres is None and not unit:
        raise ValueError(
            'robot_unit is not given and the network has no scale, accepted is m or mm'
        )
    covariance = np.diag([position_sigma**2] * 3 + [rotation_sigma**2] * 3)

    def calibrated(robot_unit: str, scale: float | None, inverted: bool = False) -> Mounted:
        given = {it: pose.inverse for it, pose in poses.items()} if inverted else poses
        stations = _stations(solution, given, METRES[robot_unit], targets_on_hand, covariance)
        return mounted(stations, targets_on_hand=targets_on_hand, scale=scale)

    def tried_with(inverted: bool) -> dict[str, Mounted]:
        found = {}
        for it in (unit,) if metres is None else ROBOT_UNITS:
            with suppress(Contradiction):
                found[it] = calibrated(it, None, inverted)
        return found

    tried = tried_with(False)
    best = min((it.sigma0 for it in tried.values()), default=np.inf)
    if best > 1 and any(it.sigma0 < _INVERTED * best for it in tried_with(True).values()):
        raise ValueError(
            'the poses of the robot are those of the base in the frame of the hand, accepted are '
            'those of the hand in the frame of the base'
        )
    if not tried:
        raise ValueError(
            'the poses of the robot and of the photographs do not fit together: check the order '
            'of the images and the convention of the rotations'
        )
    if metres is not None:
        unit, more = _unit(tried, metres, unit)
        return calibrated(unit, metres), (*notes, *more)
    result = tried[unit]
    note = (
        f'the network has no scale, and gets that of the robot: {result.scale:.6g} m, +- '
        f'{abs(result.scale_sigma / result.scale):.1e} of it'
    )
    return result, (*notes, note)


def _unit(tried: Mapping[str, Mounted], metres: float, given: str) -> tuple[str, list[str]]:
    """Return the unit of the robot's poses by the lengths that the network has, and notes."""
    ratios = {name: it.scale / metres for name, it in tried.items()}
    sigmas = {name: it.scale_sigma / metres for name, it in tried.items()}
    uncertain = all(sigmas[it] > _UNCERTAIN * abs(ratios[it]) for it in tried)
    if uncertain:
        if not given:
            raise ValueError(
                'robot_unit is not given, and the hand moved too little to tell m from mm'
            )
        return given, ['the hand moved too little to check the unit of its poses']
    fitting = [it for it in tried if abs(ratios[it] - 1) < _TOLERANCE]
    if not fitting:
        told = given if given in tried else next(iter(tried))
        raise ValueError(
            f'the hand moved {ratios[told]:.4g} times as far as the photographs if its poses are '
            f'in {told}, accepted is 1: check the scale of the network and the unit'
        )
    name = fitting[0]
    if given and given != name:
        raise ValueError(f'robot_unit is {given!r}, and the poses of the robot are in {name}')
    deviation = ratios[name] - 1
    if abs(deviation) > _SIGNIFICANT * sigmas[name]:
        return name, [
            f'the hand moved {ratios[name]:.6f} times as far as the photographs, +- '
            f'{sigmas[name]:.6f}: the scale of the network or of the robot is wrong'
        ]
    return name, []


def _matched(
    solution: Solution, table: Mapping[str, Transform]
) -> tuple[dict[int, Transform], list[str]]:
    """Return the poses of the robot by photograph, and notes on what has no counterpart."""
    names = solution.network.photographs
    found = {index: _of_image(table, names[index]) for index in np.flatnonzero(solution.oriented)}
    poses = {int(index): pose for index, pose in found.items() if pose is not None}
    if not poses:
        raise ValueError('no oriented photograph has a pose of the robot, accepted are its names')
    notes = []
    if missing := [names[index] for index in found if index not in poses]:
        notes.append(f'no pose of the robot for {listed(missing)}')
    seen = {PurePath(it).name for it in names}
    if absent := [it for it in table if PurePath(it).name not in seen]:
        notes.append(f'no photograph for the poses {listed(absent)}')
    return poses, notes


def _of_image(table: Mapping[str, _Value], name: str) -> _Value | None:
    """Return the entry of an image by its path, or by its name without folders."""
    short = {PurePath(it).name: value for it, value in table.items()}
    return table.get(name, short.get(PurePath(name).name))


def _pose(solution: Solution, index: int) -> Transform:
    """Return the pose of a camera among the targets."""
    values = solution.state
    return camera_pose(
        values.rotations[index], values.positions[index], solution.pose_covariances[index]
    )


def _stations(
    solution: Solution,
    poses: Mapping[int, Transform],
    metres: float,
    targets_on_hand: bool,
    robot_covariance: FloatArray,
) -> list[Station]:
    stations = []
    for index, robot in poses.items():
        seen = _pose(solution, index)
        robot = replace(robot.scaled(metres), covariance=robot_covariance)
        stations.append(
            Station(
                name=solution.network.photographs[index],
                place=(robot.rotation.tobytes(), robot.translation.tobytes()),
                camera=_camera(solution, index),
                robot=robot,
                seen=seen.inverse if targets_on_hand else seen,
            )
        )
    return stations


def _camera(solution: Solution, index: int) -> str:
    return solution.network.cameras[solution.network.camera_of[index]].name


def mounted_on_rig(
    solution: Solution, stations: Mapping[str, str]
) -> tuple[str, Mounted, tuple[str, ...]]:
    """Return the reference camera of a rig, in metres where the others are on it; and notes.

    `stations` are the stations by image. The reference camera is the one with the most stations;
    those that it did not take part in are not used. A ValueError is raised for a network without
    scale.
    """
    metres = METRES.get(solution.network.unit)
    if metres is None:
        raise ValueError(
            'the network has no scale in a known unit, accepted is one with scale bars or control '
            f'points in {", ".join(METRES)}'
        )
    by_station: dict[str, dict[str, int]] = defaultdict(dict)
    for index in np.flatnonzero(solution.oriented).tolist():
        station = _of_image(stations, solution.network.photographs[index])
        if station is None:
            continue
        camera = _camera(solution, index)
        if camera in by_station[station]:
            raise ValueError(f'station {station} has two images of {camera}, accepted is one')
        by_station[station][camera] = index
    counts = Counter(camera for it in by_station.values() for camera in it if len(it) > 1)
    if not counts:
        raise ValueError('no two cameras took photographs at one station')
    reference = max(sorted(counts), key=counts.__getitem__)
    rows = [
        Station(
            name=solution.network.photographs[other],
            place=station,
            camera=camera,
            robot=_pose(solution, images[reference]).scaled(metres),
            seen=_pose(solution, other).scaled(metres),
        )
        for station, images in by_station.items()
        if reference in images
        for camera, other in images.items()
        if camera != reference
    ]
    notes = []
    if alone := sum(reference not in it or len(it) < 2 for it in by_station.values()):
        notes.append(f'{counted(alone, "station")} without {reference} and another camera')
    return reference, mounted(rows, scale=1.0, field=Transform()), tuple(notes)
