"""`ahf export`, and what `ahf identify` exports at once."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ahf_ros.cli.export_options import (
    add_control_arguments,
    check_control,
    export_help,
    parsed_export,
)
from ahf_ros.interchange.export.formats import FORMATS, Export
from ahf_ros.interchange.export.survey import (
    Control,
    MeasuredImage,
    make_survey,
    notes_on,
    read_measured_images,
)
from ahf_ros.interchange.point_lists import read_point_list
from ahf_ros.text import counted


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        'results', metavar='RESULTS.jsonl', help='One JSON object per image; - is standard input.'
    )
    parser.add_argument(
        'export',
        nargs='+',
        type=parsed_export,
        metavar='FORMAT=DIR',
        help=export_help('Write the results'),
    )
    add_control_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Write each export.

    Returns
    -------
    int
        0, or 1 if a file could not be read or written, or a format cannot hold the results.

    Raises
    ------
    ValueError
        If options are not accepted.
    """
    check_control(options)
    try:
        control = control_from(options)
        images = read_measured_images(options.results)
    except ValueError as error:
        print(f'ahf export: {error}', file=sys.stderr)
        return 1
    return write_exports('export', options.export, images, control)


def control_from(options: argparse.Namespace) -> Control | None:
    """Return the control points that the options name; None if they name none.

    Raises
    ------
    ValueError
        If the list of points cannot be read or is damaged.
    """
    if options.control is None:
        return None
    points = read_point_list(options.control)
    return Control(points, options.control_crs.strip(), options.control_sigma)


def write_exports(
    command: str,
    exports: Sequence[Export],
    images: Sequence[MeasuredImage],
    control: Control | None,
    quiet: bool = False,
) -> int:
    """Write exports, each independently of the others, and report them on standard error.

    With `quiet`, only problems are reported.

    Returns
    -------
    int
        0, or 1 if one of them could not be written.
    """
    failed = False
    for export in exports:
        try:
            files = export.write(images, control)
        except ValueError as error:
            print(f'ahf {command}: {export.format}: {error}', file=sys.stderr)
            failed = True
            continue
        if quiet:
            continue
        count = f'{counted(len(images), "image")}, {counted(len(files), "file")}'
        print(f'{export.folder}: {export.format}, {count}', file=sys.stderr)
        if control and not FORMATS[export.format].control:
            print(f'{export.folder}: {export.format} has no control points', file=sys.stderr)
    if control and exports and not failed and not quiet:
        for note in notes_on(control, make_survey(images, control)):
            print(note, file=sys.stderr)
    return int(failed)
