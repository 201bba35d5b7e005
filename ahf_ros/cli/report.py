"""`ahf report`: results as one page to look at."""

import argparse
from pathlib import Path

from ahf_ros.base.text import counted
from ahf_ros.cli import say, tell
from ahf_ros.cli.engines import tracker
from ahf_ros.cli.options import (
    add_input,
    add_options,
    add_output,
    add_quiet,
    input_path,
    settings_from,
)
from ahf_ros.files.truth_files import read_truth
from ahf_ros.views.report.page import ReportSettings, write_page
from ahf_ros.views.report.results import read_results


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = 'Files of JSON lines as ahf identify --json prints them, and folders of such files.'
    add_input(parser, 'results', 'RESULTS', text, nargs='+')
    add_output(parser, '-o', 'FILE.html', 'Page to write.', required=True)
    text = 'Folder that the images have moved to. Repeatable.'
    add_input(parser, '--images', 'DIR', text, type=input_path, action='append', default=[])
    text = 'What the images show, with the columns image, id, x, y[, confirmed].'
    add_input(parser, '--truth', 'TRUTH.csv', text)
    add_quiet(parser)
    add_options(parser, ReportSettings)


def run(options: argparse.Namespace) -> int:
    """Write the page; what could be read is on it, whatever could not."""
    settings = settings_from(options, ReportSettings)
    title = ', '.join(Path(name).name for name in options.results)
    try:
        truth = read_truth(options.truth) if options.truth else None
        results, problems = read_results(options.results)
        for problem in problems:
            tell('report', problem)
        if not results:
            raise ValueError('there is no result, accepted is at least one')
        shown = len(results) > 1 and not options.quiet
        with tracker(shown, len(results), 'report') as track:
            lost = write_page(
                options.output, results, settings, title, truth, options.images, track
            )
    except ValueError as error:
        tell('report', error)
        return 1
    for problem in lost:
        tell('report', problem)
    if not options.quiet:
        size = options.output.stat().st_size / 1e6
        count = counted(len(results), 'image')
        say(f'{options.output}: {count}, {size:.1f} MB')
    return int(bool(problems or lost))
