"""Options of `ahf orient` for cameras on a robot or a rig, and what it says of their mounting."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.cli.options import add_flag, add_input, add_option, add_parsed

if TYPE_CHECKING:
    from ahf_ros.network.mounting import Mounted
    from ahf_ros.network.read import NetworkInputs
    from ahf_ros.network.solution import Solution
    from ahf_ros.network.transform import Transform

_OPTICAL = '_optical_frame'
_FIELD = 'targets'


def add_mounting_arguments(group: argparse._ArgumentGroup) -> None:
    """Give a parser what is known of a robot or a rig."""
    text = (
        'Poses of the hand in the frame of the base: image, x, y, z, and qx, qy, qz, qw or a '
        'rotation vector rx, ry, rz in rad. Writes where the cameras are on the hand.'
    )
    add_input(group, '--robot-poses', 'POSES.csv', text)
    group.add_argument(
        '--robot-unit',
        choices=('m', 'mm'),
        default='',
        help='Unit of x, y and z. A network that has a scale tells it.',
    )
    text = 'Standard deviation of positions of the hand, mm.'
    add_option(group, Parameter('robot_position_sigma', 0.1, text, minimum=1e-6))
    text = 'Standard deviation of rotations of the hand, degrees.'
    add_option(group, Parameter('robot_rotation_sigma', 0.02, text, minimum=1e-6))
    text = 'The hand moves the targets, before cameras that stand still.'
    add_flag(group, '--targets-on-hand', text)
    text = 'Names of the frames that are written. Default: base,tool0.'
    add_parsed(group, '--robot-frames', 'BASE,HAND', text, _frames, default=('base', 'tool0'))
    text = (
        'Photographs that cameras fixed to each other took at once: image, station. Writes '
        'where the cameras are on one of them.'
    )
    add_input(group, '--stations', 'STATIONS.csv', text)


def _frames(text: str) -> tuple[str, str]:
    from ahf_ros.network.files.robot_files import frame_name

    names = [it.strip() for it in text.split(',')]
    if len(names) != 2 or names[0] == names[1] or any(it != frame_name(it) for it in names):
        raise ValueError(f'robot_frames is {text!r}, accepted are two names such as base,tool0')
    return names[0], names[1]


def check_mounting(options: argparse.Namespace) -> None:
    """Raise a ValueError for options that exclude each other, or that nothing uses."""
    if options.robot_poses and options.stations:
        raise ValueError('robot_poses and stations are given, accepted is one of them')
    if not options.robot_poses:
        for name in ('robot_unit', 'targets_on_hand'):
            if getattr(options, name):
                raise ValueError(f'{name} is given without robot_poses, which it describes')


def mounting_record(
    solution: Solution, inputs: NetworkInputs, options: argparse.Namespace
) -> dict[str, Any]:
    """Return where cameras are on a robot or a rig, nothing if that is not asked for."""
    if options.robot_poses:
        return _on_robot(solution, inputs.robot_poses, options)
    return _on_rig(solution, inputs.stations) if options.stations else {}


def _on_robot(
    solution: Solution, poses: Mapping[str, Transform], options: argparse.Namespace
) -> dict[str, Any]:
    import numpy as np

    from ahf_ros.network.files.robot_files import frame_name
    from ahf_ros.network.stations import mounted_on_robot

    result, notes = mounted_on_robot(
        solution,
        poses,
        position_sigma=options.robot_position_sigma * 1e-3,
        rotation_sigma=float(np.radians(options.robot_rotation_sigma)),
        unit=options.robot_unit,
        targets_on_hand=options.targets_on_hand,
    )
    base, hand = options.robot_frames

    def name(camera: str) -> str:
        return frame_name(camera) + _OPTICAL if camera else _FIELD

    parts = [
        (parent, name(camera), pose)
        for parent, places in ((hand, result.mounts), (base, result.fields))
        for camera, pose in places.items()
    ]
    return _record(result, parts, notes)


def _on_rig(solution: Solution, stations: Mapping[str, str]) -> dict[str, Any]:
    from ahf_ros.network.files.robot_files import frame_name
    from ahf_ros.network.stations import mounted_on_rig

    reference, result, notes = mounted_on_rig(solution, stations)
    parts = [
        (frame_name(reference) + _OPTICAL, frame_name(camera) + _OPTICAL, pose)
        for camera, pose in result.mounts.items()
    ]
    return _record(result, parts, notes)


def _record(
    result: Mounted, parts: list[tuple[str, str, Transform]], notes: tuple[str, ...]
) -> dict[str, Any]:
    from ahf_ros.network.files.robot_files import transform_record

    return {
        'unit': 'm',
        'sigma0': result.sigma0,
        'redundancy': result.redundancy,
        'scale': result.scale,
        'transforms': [transform_record(*part) for part in parts],
        'residuals': [
            {'image': image, 'translation': gaps[:3].tolist(), 'rotation': gaps[3:].tolist()}
            for image, gaps in result.residuals.items()
        ],
        'rejected': [
            {
                'image': image,
                'reason': 'its pose of the robot contradicts all others',
                'normalised_residual': size,
            }
            for image, size in result.rejected.items()
        ],
        'warnings': list(notes),
    }


def print_mounting(record: dict[str, Any]) -> None:
    """Print where cameras are on standard error."""
    import numpy as np
    from rich.markup import escape

    from ahf_ros.cli.tables import print_table, terminal

    console = terminal()
    rows = []
    for it in record['transforms']:
        sigma = np.sqrt(np.diag(it['covariance']))
        place = [f'{1e3 * value:.3f}' for value in it['translation']]
        precision = f'{1e3 * sigma[:3].max():.3f}', f'{np.degrees(sigma[3:].max()):.4f}'
        rows.append([f'{it["parent"]} to {it["child"]}', *place, *precision])
    head = 'static transform', 'x, mm', 'y', 'z', 'sigma', 'sigma, degrees'
    print_table('Mounting', head, rows, console)
    gaps = np.array([[*it['translation'], *it['rotation']] for it in record['residuals']])
    lengths = np.sqrt((gaps[:, :3] ** 2).sum(axis=1).mean())
    turns = np.degrees(np.sqrt((gaps[:, 3:] ** 2).sum(axis=1).mean()))
    console.print(
        f'{len(gaps)} poses agree within {1e3 * lengths:.3f} mm and {turns:.4f} degrees (RMS), '
        f'sigma0 {record["sigma0"]:.2f}',
        highlight=False,
    )
    rejected = [f'{it["image"]}: {it["reason"]}' for it in record['rejected']]
    for text in (*rejected, *record['warnings']):
        console.print(f'[yellow]![/] {escape(text)}', highlight=False)
