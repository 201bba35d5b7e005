"""The options of exports and control points, of `ahf export` and `ahf identify`."""

from __future__ import annotations

import argparse

from ahf_ros.cli.options import Group, add_option
from ahf_ros.interchange.export.formats import FORMATS, Export
from ahf_ros.settings.parameter import Parameter

CONTROL_CRS = Parameter(
    'control_crs',
    '',
    'Coordinate reference system of the control points, such as EPSG:25832; empty for local '
    'coordinates.',
)
CONTROL_SIGMA = Parameter(
    'control_sigma',
    0.0,
    'Standard deviation of the coordinates of control points, in their unit; 0: unknown.',
    minimum=0.0,
)


def add_export_arguments(parser: Group) -> None:
    """Give another command, or a group of it, the options that export what it identifies."""
    parser.add_argument(
        '--export',
        action='append',
        default=[],
        type=parsed_export,
        metavar='FORMAT=DIR',
        help=export_help('Also write the results, once all images are identified,')
        + ' Repeatable.',
    )
    add_control_arguments(parser)


def add_control_arguments(parser: Group) -> None:
    """Give a parser the options for control points."""
    parser.add_argument(
        '--control',
        metavar='POINTS.csv',
        help='Control points to export: ID, x, y, z.',
    )
    add_option(parser, CONTROL_CRS)
    add_option(parser, CONTROL_SIGMA)


def check_control(options: argparse.Namespace) -> None:
    """Raise a ValueError if options describe control points that are not given or exported."""
    if options.control and not options.export:
        raise ValueError('control is given without export, accepted is both')
    if not options.control and (options.control_crs or options.control_sigma):
        raise ValueError('control_crs or control_sigma is given without control, accepted is both')
    if not options.control_crs.isprintable():
        raise ValueError(f'control_crs is {options.control_crs!r}, accepted is one line of text')


def parsed_export(text: str) -> Export:
    """Return the export that an argument stands for."""
    try:
        return Export.parsed(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def export_help(action: str) -> str:
    """Return the help of an argument that is an export."""
    return f'{action} to a folder as other software reads them: {", ".join(FORMATS)}.'
