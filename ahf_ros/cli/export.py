"""`ahf export`, and what `ahf identify` exports at once.

What computes is imported where it is used, because `ahf identify --help` lists the formats.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.text import counted
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import Group, add_input, add_option, add_parsed
from ahf_ros.network.export.formats import FORMATS, Export

if TYPE_CHECKING:
    from ahf_ros.network.export.survey import Control, MeasuredImage

_FOLDER = f'to a folder as other software reads them: {", ".join(FORMATS)}.'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = 'One JSON object per image; - is standard input.'
    add_input(parser, 'results', 'RESULTS.jsonl', text)
    text = f'Write the results {_FOLDER}'
    add_parsed(parser, 'export', 'FORMAT=DIR', text, Export.parsed, nargs='+')
    _add_control_arguments(parser)


def add_export_arguments(parser: Group) -> None:
    """Give another command, or a group of it, the options that export what it identifies."""
    text = f'Also write the results, once all images are identified, {_FOLDER} Repeatable.'
    add_parsed(parser, '--export', 'FORMAT=DIR', text, Export.parsed, action='append', default=[])
    _add_control_arguments(parser)


def _add_control_arguments(parser: Group) -> None:
    add_input(parser, '--control', 'POINTS.csv', 'Control points to export: ID, x, y, z.')
    text = (
        'Coordinate reference system of the control points, such as EPSG:25832; empty for local '
        'coordinates.'
    )
    add_option(parser, Parameter('control_crs', '', text))
    text = 'Standard deviation of the coordinates of control points, in their unit; 0: unknown.'
    add_option(parser, Parameter('control_sigma', 0.0, text, minimum=0.0))


def run(options: argparse.Namespace) -> int:
    """Write each export."""
    from ahf_ros.network.export.survey import read_measured_images

    check_control(options)
    try:
        control = control_from(options)
        images = read_measured_images(options.results)
    except ValueError as error:
        tell('export', error)
        return 1
    return int(not write_exports('export', options.export, images, control))


def check_control(options: argparse.Namespace) -> None:
    """Raise a ValueError if options describe control points that are not given or exported."""
    if options.control and not options.export:
        raise ValueError('control is given without export, accepted is both')
    if not options.control and (options.control_crs or options.control_sigma):
        raise ValueError('control_crs or control_sigma is given without control, accepted is both')
    if not options.control_crs.isprintable():
        raise ValueError(f'control_crs is {options.control_crs!r}, accepted is one line of text')


def control_from(options: argparse.Namespace) -> Control | None:
    """Return the control points that the options name; None if they name none.

    A ValueError says so if the list of points cannot be read or is damaged.
    """
    if options.control is None:
        return None
    from ahf_ros.files.tables import read_points
    from ahf_ros.network.export.survey import Control

    points = read_points(options.control)
    return Control(points, options.control_crs.strip(), options.control_sigma)


def write_exports(
    command: str,
    exports: Sequence[Export],
    images: Sequence[MeasuredImage],
    control: Control | None,
    quiet: bool = False,
) -> bool:
    """Write exports, each independently of the others, and return whether all are written.

    They are reported on standard error; with `quiet`, only problems are.
    """
    from ahf_ros.network.export.survey import make_survey, notes_on

    written = True
    for export in exports:
        try:
            files = export.write(images, control)
        except ValueError as error:
            tell(command, f'{export.format}: {error}')
            written = False
            continue
        if quiet:
            continue
        count = f'{counted(len(images), "image")}, {counted(len(files), "file")}'
        say(f'{export.folder}: {export.format}, {count}')
        if control and not FORMATS[export.format].control:
            say(f'{export.folder}: {export.format} has no control points')
    if control and exports and written and not quiet:
        for note in notes_on(control, make_survey(images, control)):
            say(note)
    return written
