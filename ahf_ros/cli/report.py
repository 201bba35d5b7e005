"""`ahf report`: results as one page to look at."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from ahf_ros.cli.options import add_options, settings_from
from ahf_ros.interchange.truth_files import read_truth
from ahf_ros.report.page import make_page, page_pictures, write_page
from ahf_ros.report.results import read_results
from ahf_ros.report.settings import ReportSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        'results',
        nargs='+',
        metavar='RESULTS',
        help='Files of JSON lines as ahf identify --json prints them, and folders of such files.',
    )
    parser.add_argument(
        '-o', '--output', type=Path, required=True, metavar='FILE.html', help='Page to write.'
    )
    parser.add_argument(
        '--images',
        type=Path,
        action='append',
        default=[],
        metavar='DIR',
        help='Folder that the images have moved to. Repeatable.',
    )
    parser.add_argument(
        '--truth',
        metavar='TRUTH.csv',
        help='What the images show, with the columns image, id, x, y[, confirmed].',
    )
    parser.add_argument(
        '--quiet', action='store_true', help='Print nothing on standard error but problems.'
    )
    add_options(parser, ReportSettings)


def run(options: argparse.Namespace) -> int:
    """Write the page.

    Returns
    -------
    int
        0, or 1 if a file could not be read or written; what could be read is on the page.

    Raises
    ------
    ValueError
        If options are not accepted.
    """
    settings = settings_from(options, ReportSettings)
    try:
        truth = read_truth(options.truth) if options.truth else None
    except ValueError as error:
        _tell(str(error))
        return 1
    results, problems = read_results(options.results)
    for problem in problems:
        _tell(problem)
    if not results:
        _tell('there is no result, accepted is at least one')
        return 1
    title = ', '.join(Path(name).name for name in options.results)
    page = make_page(results, settings, title, truth)
    pictures = page_pictures(results, page, settings.threads, options.images)
    shown = sys.stderr.isatty() and not options.quiet and len(results) > 1
    try:
        with Progress(console=Console(stderr=True, quiet=not shown), transient=True) as progress:
            track = progress.track(pictures, total=len(results), description='report')
            lost = write_page(options.output, page, track)
    except ValueError as error:
        _tell(str(error))
        return 1
    for problem in lost:
        _tell(problem)
    if not options.quiet:
        size = options.output.stat().st_size / 1e6
        count = f'{len(results)} image' + 's' * (len(results) > 1)
        print(f'{options.output}: {count}, {size:.1f} MB', file=sys.stderr)
    return int(bool(problems or lost))


def _tell(problem: str) -> None:
    print(f'ahf report: {problem}', file=sys.stderr)
