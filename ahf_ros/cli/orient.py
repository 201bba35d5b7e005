"""`ahf orient`: coordinates of targets, poses and calibrations from identified targets alone.

What computes is imported where it is used, so that `ahf orient --help` is fast.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ahf_ros.base.extras import need
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.text import printable
from ahf_ros.cli import tell
from ahf_ros.cli.mounting import (
    add_mounting_arguments,
    check_mounting,
    mounting_record,
    print_mounting,
)
from ahf_ros.cli.options import (
    add_flag,
    add_input,
    add_option,
    add_output,
    add_parsed,
    add_quiet,
    input_path,
)
from ahf_ros.network.export.formats import NETWORK_FORMATS, parsed_export

if TYPE_CHECKING:
    from rich.console import Console

    from ahf_ros.network.network import Network
    from ahf_ros.network.progress import Watcher
    from ahf_ros.network.read import NetworkFiles, NetworkInputs
    from ahf_ros.network.solution import Solution

REPORT_FILE = 'report.html'

CONTRADICTED = 3
"""Exit status where all is written, but what was observed and what is known do not agree."""

_LENGTH = re.compile(r'(?P<number>[0-9.]+(e[+-]?[0-9]+)?) *(?P<unit>px|mm)?', re.IGNORECASE)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = (
        'Output of ahf identify --json, - is standard input; or a table of another program '
        'that ends with .csv: image, id, x, y, and perhaps sigma, width and height.'
    )
    add_input(parser, 'observations', 'RESULTS.jsonl', text)
    add_output(parser, '-o', 'DIR', 'Folder to write.', required=True)
    _add_camera_arguments(parser.add_argument_group('cameras'))
    _add_object_arguments(parser.add_argument_group('object'))
    _add_observation_arguments(parser.add_argument_group('observations'))
    add_mounting_arguments(parser.add_argument_group('robots and rigs'))
    text = (
        'Also write cameras, poses and targets for other software: '
        f'{", ".join(NETWORK_FORMATS)}. Repeatable.'
    )
    exported = partial(parsed_export, formats=NETWORK_FORMATS)
    add_parsed(parser, '--export', 'FORMAT=DIR', text, exported, action='append', default=[])
    parser.add_argument(
        '--progress',
        action=argparse.BooleanOptionalAction,
        help='Whether to show stages, photographs and iterations on standard error: on a terminal '
        'as one line that goes when all is done, elsewhere as lines. Default: on a terminal.',
    )
    add_quiet(parser)


def _add_camera_arguments(group: argparse._ArgumentGroup) -> None:
    text = 'Calibration of a camera, as ROS (camera_info), OpenCV or Kalibr write it. Repeatable.'
    add_input(group, '--calibration', 'CAMERA.yaml', text, action='append', default=[])
    text = 'Adjust given calibrations, too; without this they are kept as they are.'
    add_flag(group, '--adjust-calibration', text)
    text = (
        'Start value of the focal length: 3200px, or 35mm as its equivalent on film, by the '
        'diagonal. Without it, Exif data are used, and nothing where there are none.'
    )
    add_parsed(group, '--focal-length', 'LENGTH', text, _focal_length)
    text = (
        'Lenses are equidistant fisheye ones, after Kannala and Brandt. Without this, they '
        "are taken for such where Brown's model does not describe the border of the images."
    )
    add_flag(group, '--fisheye', text)
    text = (
        'Which camera took which photograph: image, camera. Without it, photographs of one '
        'size, and one camera and focal length in their Exif data, are of one camera.'
    )
    add_input(group, '--cameras', 'CAMERAS.csv', text)
    text = 'Folder that the photographs have moved to; their Exif data are read. Repeatable.'
    add_input(group, '--images', 'DIR', text, type=input_path, action='append', default=[])


def _add_object_arguments(group: argparse._ArgumentGroup) -> None:
    text = 'Known distances: id_1, id_2, length, sigma, and perhaps role, control or check.'
    add_input(group, '--scale-bars', 'BARS.csv', text)
    text = (
        'Known coordinates: id, x, y, z, and perhaps sigma_x, sigma_y, sigma_z or '
        'covariance_xx to covariance_zz, and role, control or check.'
    )
    add_input(group, '--control', 'POINTS.csv', text)
    text = 'Standard deviation of control points where the table has none; 0 fixes them.'
    add_option(group, Parameter('control_sigma', 0.0, text, minimum=0.0))
    add_option(group, Parameter('unit', 'mm', 'Unit of scale bars and control points.'))
    text = (
        'Frame of the coordinates: inner (constraints on all targets) or inner:ID,ID,...; '
        'control; fixed:ID,ID,ID (origin, x axis, plane z = 0). Default: control if there are '
        'control points, else inner.'
    )
    add_parsed(group, '--datum', 'DATUM', text, _datum)

    text = (
        'Use scale bars and control points that contradict the photographs all the same. '
        'Without this they are named and left out.'
    )
    add_flag(group, '--keep-suspects', text)


def _add_observation_arguments(group: argparse._ArgumentGroup) -> None:
    text = 'Standard deviation of coordinates of image points without covariance, px.'
    add_option(group, Parameter('sigma', 0.1, text, minimum=1e-4, maximum=100.0))
    text = (
        'Coordinates that a table has at the centre of the first pixel, px: 0, or 0.5 where '
        '(0, 0) is the corner of the image.'
    )
    add_option(group, Parameter('origin', 0.0, text, minimum=0.0, maximum=1.0))


def _focal_length(text: str) -> tuple[float, str]:
    match = _LENGTH.fullmatch(text.strip())
    with suppress(ValueError):
        if match and float(match['number']) > 0:
            return float(match['number']), (match['unit'] or 'px').lower()
    raise ValueError(f'focal_length is {text!r}, accepted is a length such as 3200px or 35mm')


def _datum(text: str) -> tuple[str, tuple[str, ...]]:
    kind, _, names = text.partition(':')
    targets = tuple(name.strip() for name in names.split(',') if name.strip())
    accepted = {'inner': True, 'control': not targets, 'fixed': len(targets) in (0, 3)}
    if not accepted.get(kind, False):
        raise ValueError(
            f'datum is {text!r}, accepted is inner, inner:ID,ID,..., control, fixed or '
            'fixed:ID,ID,ID'
        )
    return kind, targets


def run(options: argparse.Namespace) -> int:
    """Orient the photographs, and write each group of them that hangs together."""
    need('orient')
    from ahf_ros.network.read import read_network_inputs
    from ahf_ros.network.verdict import contradicted

    try:
        check_mounting(options)
        inputs = read_network_inputs(_files(options))
        with shown_progress(options.progress, options.quiet) as watcher:
            solutions = _oriented(inputs.network, options, watcher)
        if not solutions:
            raise ValueError('no photograph could be oriented')
    except ValueError as error:
        tell('orient', error)
        return 1
    solutions = [
        replace(it, warnings=(*inputs.notes, *_of_groups(solutions, number), *it.warnings))
        for number, it in enumerate(solutions)
    ]
    written = [_write(it, number, inputs, options) for number, it in enumerate(solutions)]
    if not all(written):
        return 1
    return CONTRADICTED if any(map(contradicted, solutions)) else 0


def _files(options: argparse.Namespace) -> NetworkFiles:
    from ahf_ros.network.read import NetworkFiles

    return NetworkFiles(
        observations=options.observations,
        images=options.images,
        cameras=options.cameras or '',
        calibrations=options.calibration,
        scale_bars=options.scale_bars or '',
        control=options.control or '',
        robot_poses=options.robot_poses or '',
        stations=options.stations or '',
        origin=options.origin,
        sigma=options.sigma,
        control_sigma=options.control_sigma,
        unit=options.unit,
        focal_length=options.focal_length,
        adjusted=options.adjust_calibration,
        equidistant=options.fisheye,
    )


@contextmanager
def shown_progress(wanted: bool | None, quiet: bool) -> Iterator[Watcher | None]:
    """Yield what shows the steps of an orientation, None if they are not wanted.

    On a terminal they are one line that renews itself and is gone at the end. Elsewhere each
    stage, and how much of it is done, is a line, without the iterations.
    """
    from ahf_ros.cli.tables import terminal

    is_terminal = sys.stderr.isatty()
    if not (is_terminal and not quiet if wanted is None else wanted):
        yield None
    elif is_terminal:
        with terminal().status('') as status:
            yield lambda progress: status.update(str(progress))
    else:
        yield lambda progress: None if progress.iteration else tell('orient', progress)


def _oriented(
    network: Network, options: argparse.Namespace, watcher: Watcher | None
) -> list[Solution]:
    from ahf_ros.network.datum import Datum
    from ahf_ros.network.orient import orient
    from ahf_ros.network.solution import separated

    datum = Datum(*options.datum) if options.datum else Datum()
    suspects = options.keep_suspects
    return separated(orient(network, datum, keep_suspects=suspects, progress=watcher))


def _of_groups(solutions: Sequence[Solution], number: int) -> tuple[str, ...]:
    """Return that a group is one of several, and that its unit is unlikely."""
    import numpy as np

    from ahf_ros.network.units import unlikely

    points = solutions[number].measured_points
    notes = [unlikely(float(np.linalg.norm(np.ptp(points.xyz, axis=0))), points.unit)]
    if len(solutions) > 1:
        notes.append(
            f'group {number + 1} of {len(solutions)} that have too few targets in common, each in '
            'a frame of its own'
        )
    return tuple(it for it in notes if it)


def _write(
    solution: Solution, number: int, inputs: NetworkInputs, options: argparse.Namespace
) -> bool:
    """Write a network and its exports, print what was found, and return whether all is written."""
    from ahf_ros.network.export.formats import network_remark, write_network_export
    from ahf_ros.network.files.network_results import write_network
    from ahf_ros.network.files.robot_files import mounting_files
    from ahf_ros.network.report.page import network_page

    def folder_in(place: Path) -> Path:
        return place / f'group_{number + 1}' if number else place

    def export(name: str, place: Path) -> None:
        write_network_export(name, folder_in(place), solution)
        if not options.quiet and (remark := network_remark(name, solution)):
            tell('orient', remark)

    def page() -> None:
        beside[REPORT_FILE] = network_page(solution, Path(options.observations).name)

    def mount() -> None:
        if record := mounting_record(solution, inputs, options):
            mounted.append(record)
            beside.update(mounting_files(record))

    folder = folder_in(options.output)
    beside: dict[str, bytes] = {}
    mounted: list[dict[str, Any]] = []
    steps: list[Callable[[], object]] = [
        page,
        mount,
        partial(write_network, folder, solution, beside),
        *(partial(export, name, place) for name, place in options.export),
    ]
    written = True
    for step in steps:
        try:
            step()
        except ValueError as error:
            tell('orient', error)
            written = False
    if not options.quiet:
        print_network(solution, str(folder))
        for record in mounted:
            print_mounting(record)
    return written


def print_network(solution: Solution, folder: str, console: Console | None = None) -> None:
    """Print a network on standard error."""
    from rich.markup import escape

    from ahf_ros.cli.tables import print_table, terminal
    from ahf_ros.network.report import summary as network_summary
    from ahf_ros.network.verdict import verdict

    console = console or terminal()
    judged = verdict(solution)
    colour = {'good': 'green', 'weak': 'yellow', 'bad': 'red'}[judged.grade]
    console.print(f'[bold {colour}]{escape(printable(judged.line, 2000))}[/]', highlight=False)
    for table in network_summary.tables(solution, folder):
        print_table(*table, console)
    for mark, texts in (('yellow]!', solution.warnings), ('cyan]>', judged.to_do)):
        for text in texts:
            console.print(f'[{mark}[/] {escape(printable(text, len(text)))}', highlight=False)
