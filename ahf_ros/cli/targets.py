"""`ahf targets`: sheets of targets to print."""

from __future__ import annotations

import argparse
from pathlib import Path

from ahf_ros.cli import say, tell
from ahf_ros.cli.options import add_options, settings_from
from ahf_ros.interchange.files import write_whole
from ahf_ros.printing.files import geometry_text, sheet_files
from ahf_ros.printing.settings import SheetSettings
from ahf_ros.printing.sheets import Sheets
from ahf_ros.text import counted


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        required=True,
        metavar='FILE',
        help='Sheet to write, .pdf or .svg. Several pages of SVG are FILE_1.svg and so on.',
    )
    parser.add_argument(
        '--geometry',
        type=Path,
        metavar='FILE.json',
        help='Write ID, page and centre of each target and the radii, in mm.',
    )
    add_options(parser, SheetSettings)


def run(options: argparse.Namespace) -> int:
    """Write the sheets and their geometry, each file independently of the others."""
    sheets = Sheets(settings_from(options, SheetSettings))
    failed = False
    files = list(sheet_files(options.output, sheets))
    if options.geometry:
        if options.geometry.resolve() in {path.resolve() for path, _ in files}:
            raise ValueError(
                f'geometry is {str(options.geometry)!r}, accepted is a file other than the sheet'
            )
        files.append((options.geometry, geometry_text(sheets).encode()))
    for path, content in files:
        try:
            write_whole(path, content)
        except ValueError as error:
            tell('targets', error)
            failed = True
    if failed:
        return 1
    pages = counted(sheets.count, 'page')
    say(f'{options.output}: {sheets.title}, on {pages} {sheets.settings.paper.name}')
    if sheets.settings.best:
        say(f'IDs: {", ".join(map(str, sheets.numbers))}')
    return 0
