"""`ahf targets`: sheets of targets to print."""

import argparse

from ahf_ros.base.text import counted
from ahf_ros.base.writing import write_files, write_whole
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import add_options, add_output, settings_from
from ahf_ros.prints.printing.files import geometry_text, sheet_files
from ahf_ros.prints.printing.settings import SheetSettings
from ahf_ros.prints.printing.sheets import Sheets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = 'Sheet to write, .pdf or .svg. Several pages of SVG are FILE_1.svg and so on.'
    add_output(parser, '-o', 'FILE', text, required=True)
    text = 'Write ID, page and centre of each target and the radii, in mm.'
    add_output(parser, '--geometry', 'FILE.json', text)
    add_options(parser, SheetSettings)


def run(options: argparse.Namespace) -> int:
    """Write the sheets, all or none, and their geometry."""
    sheets = Sheets(settings_from(options, SheetSettings))
    files = dict(sheet_files(options.output, sheets))
    if options.geometry and options.geometry.resolve() in {path.resolve() for path in files}:
        raise ValueError(
            f'geometry is {str(options.geometry)!r}, accepted is a file other than the sheet'
        )
    try:
        if options.geometry:
            write_whole(options.geometry, geometry_text(sheets).encode())
        if len(files) == 1:
            write_whole(*files.popitem())
        else:
            write_files(options.output.parent, ((it.name, files[it]) for it in files))
    except ValueError as error:
        tell('targets', error)
        return 1
    pages = counted(sheets.count, 'page')
    say(f'{options.output}: {sheets.title}, on {pages} {sheets.settings.paper.name}')
    if sheets.settings.best:
        say(f'IDs: {", ".join(map(str, sheets.numbers))}')
    return 0
