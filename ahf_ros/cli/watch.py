"""`ahf watch`: the coded targets in the images that arrive in a folder."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing, redirect_stdout
from pathlib import Path
from typing import TextIO

from ahf_ros.batch.engine import EngineLost, available_cores
from ahf_ros.batch.identification import (
    ImageTask,
    detector_of,
    identify_images,
    with_machine,
)
from ahf_ros.batch.results import Results, Unwritable
from ahf_ros.batch.watch import Arrivals, watch
from ahf_ros.cli.engines import create_engine, shared_settings
from ahf_ros.cli.identify_options import add_output_options, add_processing_options
from ahf_ros.cli.options import (
    add_option,
    add_search_options,
    add_target_options,
    settings_from,
)
from ahf_ros.cli.outcomes import overlay_path, print_outcome
from ahf_ros.interchange.files import RESULTS_FILE
from ahf_ros.interchange.image_files import SUFFIXES
from ahf_ros.session import create_identifier
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.parameter import Parameter

SETTLING = Parameter(
    'settling',
    1.0,
    'Time for which size and time of change of a file have to stay the same before it is read, s.',
    minimum=0.0,
    maximum=3600.0,
)
INTERVAL = Parameter(
    'interval',
    1.0,
    'Time between two looks at the folder, s.',
    minimum=0.1,
    maximum=3600.0,
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument('folder', type=Path, metavar='FOLDER', help='Where images arrive.')
    parser.add_argument(
        '--output',
        type=Path,
        required=True,
        metavar='DIR',
        help=f'Write results to {RESULTS_FILE} in this folder. What is there already is not '
        'identified again unless settings or the file have changed.',
    )
    parser.add_argument(
        '--recursive', action='store_true', help='Look at the folders in the folder, too.'
    )
    add_option(parser, SETTLING)
    add_option(parser, INTERVAL)
    add_processing_options(parser)
    add_target_options(parser)
    add_output_options(parser.add_argument_group('output'))
    add_search_options(parser)


def run(options: argparse.Namespace) -> int:
    """Identify images as they arrive, until a signal ends this process.

    Returns
    -------
    int
        1 if the results cannot be written.

    Raises
    ------
    ValueError
        If options contradict each other.
    """
    output = sys.stdout
    with redirect_stdout(sys.stderr):  # what other detectors print is not JSON
        return _run(options, output)


def _run(options: argparse.Namespace, output: TextIO) -> int:
    settings = settings_from(options, IdentificationSettings)
    _check_overlay(options)
    # Refuses what does not fit together.
    create_identifier(detector=detector_of(settings), settings=settings)
    jobs = options.jobs or available_cores()
    shared = shared_settings(settings, jobs, options.scheduler)

    def task_of(path: str) -> ImageTask:
        overlays = (overlay_path(options.overlay, path),) if options.overlay else ()
        folder = str(Path.cwd()) if options.scheduler else ''
        return ImageTask(
            (path,), shared, upright=options.upright, overlays=overlays, folder=folder
        )

    def say(text: str) -> None:
        print(f'ahf watch: {text}', file=sys.stderr)

    engine = create_engine(
        'watch', identify_images, jobs, options.scheduler, with_machine, isolated=True
    )
    arrivals = Arrivals(options.folder, SUFFIXES, options.recursive, options.settling)
    try:
        with closing(Results(options.output)) as results, closing(engine):
            for outcome in watch(engine, arrivals, results, task_of, options.interval, say):
                print_outcome('watch', outcome, output if options.json else None, options.quiet)
    except (EngineLost, Unwritable) as error:
        say(str(error))
    return 1


def _check_overlay(options: argparse.Namespace) -> None:
    """Refuse a folder of overlays that would be watched itself."""
    if not options.overlay:
        return
    watched, drawn = options.folder.resolve(), options.overlay.resolve()
    if drawn == watched or (options.recursive and watched in drawn.parents):
        raise ValueError(
            f'overlay is {str(options.overlay)!r}, accepted is a folder that is not watched'
        )
